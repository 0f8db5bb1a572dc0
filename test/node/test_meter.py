# SPDX-License-Identifier: Apache-2.0
"""The meter of a node's process: processor time by thread, and memory."""

from __future__ import annotations

import mmap
import os
import threading
import time

import pytest

from gdfe_ros.threads import show_name
from test.node.meter import read_memory, read_processor


def test_processor_time_is_told_by_thread() -> None:
    """A thread that computes for 0.1 s of processor time increases the time under its name by as much."""
    done, over = threading.Event(), threading.Event()

    def compute() -> None:
        show_name()
        while time.thread_time() < 0.1:
            pass
        done.set()
        over.wait()

    before = read_processor(os.getpid())
    thread = threading.Thread(target=compute, name="gdfe-computes-long")
    thread.start()
    done.wait()
    spent = read_processor(os.getpid()).since(before)
    over.set()
    thread.join()
    assert spent.threads["gdfe-computes-l"] == pytest.approx(0.1, abs=0.05)
    assert spent.total >= spent.threads["gdfe-computes-l"]


def test_memory_is_told() -> None:
    """Writing to a new mapping of 50 MB adds as much resident memory; malloc may reuse resident memory."""
    before = read_memory(os.getpid())
    with mmap.mmap(-1, 50_000_000) as block:
        block.write(bytes([1]) * len(block))
        assert read_memory(os.getpid()) - before > 45_000_000

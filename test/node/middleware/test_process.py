# SPDX-License-Identifier: Apache-2.0
"""Signals: the first one requests an orderly end, a much later one ends the process at once."""

from __future__ import annotations

from test.written import run_python

_CODE = """
import os, signal, sys, threading
from gdfe_ros.node.middleware import process
process._INSIST = float(sys.argv[1])
if "ignored" in sys.argv:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
stopping = threading.Event()
process._catch_signals(stopping)
os.kill(os.getpid(), signal.SIGINT)
assert stopping.wait(10)
os.kill(os.getpid(), signal.SIGTERM)
print("goes on")
"""


def test_signals_in_quick_succession_are_one() -> None:
    """SIGINT and SIGTERM in quick succession lead to an orderly end."""
    done = run_python(_CODE, 60.0)
    assert (done.returncode, done.stdout) == (0, "goes on\n"), done.stderr


def test_a_later_signal_ends_the_process_at_once() -> None:
    """A later second signal ends the process with its status, and stderr says how to recover the bag."""
    done = run_python(_CODE, -1.0)
    assert (done.returncode, done.stdout) == (128 + 15, "")
    assert done.stderr == "ended at once; `gdfe recover` completes a bag that was cut off\n"


def test_a_signal_ends_a_node_that_a_script_has_started() -> None:
    """SIGINT that was ignored at the start, as in the background of a shell script, leads to an orderly end, too."""
    done = run_python(_CODE, 60.0, "ignored")
    assert (done.returncode, done.stdout) == (0, "goes on\n"), done.stderr

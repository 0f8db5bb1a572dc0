# SPDX-License-Identifier: Apache-2.0
"""Limits of time and memory for the fuzzing tests."""

from __future__ import annotations

import resource
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from test.torture.examples import EXAMPLES

MEMORY, SECONDS = 4 << 30, 300 + EXAMPLES
"""Address space [bytes] that a fuzzing test may use in addition, and its longest time [s]."""


@pytest.fixture
def limited() -> Iterator[None]:
    """Limit memory and time of a test: beyond the limits, its process raises MemoryError or TimeoutError."""

    def end(*_: object) -> None:
        raise TimeoutError(f"the examples took more than {SECONDS} s")

    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before, most = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, most))
    handler = signal.signal(signal.SIGALRM, end)
    signal.alarm(SECONDS)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, handler)
    resource.setrlimit(resource.RLIMIT_AS, (before, most))

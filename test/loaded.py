# SPDX-License-Identifier: Apache-2.0
"""Repeated runs of the tests beside processes that keep cores busy, to find tests that pass on an idle machine only.

``python test/loaded.py [--runs 5] [--loops 2] [arguments of pytest]`` prints the time of each run and every failure.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

_BUSY = [sys.executable, "-c", "while True: pass"]


@contextmanager
def busy(loops: int) -> Iterator[None]:
    """Keep ``loops`` cores busy inside the context."""
    running = [subprocess.Popen(_BUSY) for _ in range(loops)]
    try:
        yield
    finally:
        for process in running:
            process.kill()
            process.wait()


def run(arguments: Sequence[str]) -> tuple[bool, str]:
    """Run the tests once; return whether they passed, and the end of their report: failures and counts."""
    command = [sys.executable, "-m", "pytest", "-q", "--no-header", *arguments]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    if done.returncode != 0:
        return False, done.stdout[-20_000:]
    return True, done.stdout.splitlines()[-1]


def main() -> int:
    """Run the tests; return exit status 1 if one failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--loops", type=int, default=2)
    options, arguments = parser.parse_known_args()
    failed = 0
    with busy(options.loops):
        for number in range(1, options.runs + 1):
            begin = time.monotonic()
            passed, report = run(arguments)
            failed += not passed
            took = f"{time.monotonic() - begin:.0f} s beside {options.loops} loops"
            print(f"run {number} of {options.runs}: {took}\n{report}", flush=True)
    print(f"{failed} of {options.runs} runs failed")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())

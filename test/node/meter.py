# SPDX-License-Identifier: Apache-2.0
"""Processor time and memory of another process, thread by thread (Linux)."""

from __future__ import annotations

import os
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Reading:
    """Processor time that a process has used so far.

    Attributes:
        threads: dict from name of a thread to its processor time [s]; times of threads with the same name are added.
    """

    threads: dict[str, float]

    @property
    def total(self) -> float:
        """Processor time of all threads [s]."""
        return sum(self.threads.values())

    def since(self, earlier: Reading) -> Reading:
        """Return the processor times since an earlier reading."""
        return Reading({name: spent - earlier.threads.get(name, 0.0) for name, spent in self.threads.items()})


def read_processor(pid: int) -> Reading:
    """Return the processor times of a process from the scheduler's statistics [ns]; ended threads are not included."""
    threads: dict[str, float] = defaultdict(float)
    for task in Path(f"/proc/{pid}/task").iterdir():
        try:
            name = (task / "comm").read_text(encoding="utf-8").strip()
            threads[name] += int((task / "schedstat").read_text(encoding="utf-8").split()[0]) * 1e-9
        except (FileNotFoundError, ProcessLookupError):  # it ended since it was listed
            continue
    return Reading(dict(threads))


def read_memory(pid: int) -> int:
    """Return the resident memory of a process [B]."""
    pages = Path(f"/proc/{pid}/statm").read_text(encoding="utf-8").split()[1]
    return int(pages) * os.sysconf("SC_PAGE_SIZE")

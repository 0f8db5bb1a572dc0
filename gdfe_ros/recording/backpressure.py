# SPDX-License-Identifier: Apache-2.0
"""Policy for a disk that is slower than the simulation."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class BackPressure(Enum):
    """Behaviour of ``Recorder.record`` while its queue is full because the disk is slower than the simulation.

    ``DROP`` rejects the message at once; it is for runs under the wall clock, which must not wait. ``BLOCK`` waits for
    space in the queue, at most for ``block_seconds``, and then rejects the message; it is for other runs, whose bags
    should be complete. ``RecorderStatus`` counts every rejected message.
    """

    DROP = "drop"
    BLOCK = "block"


@dataclass(frozen=True, kw_only=True)
class QueueOptions:
    """Options of the queue between simulation and writer.

    Args:
        max_bytes: largest size of the waiting messages [B], 1 MiB or more. An empty queue takes a message of any size.
        back_pressure: behaviour while the queue is full.
        block_seconds: longest wait under ``BLOCK`` [s], 0 or more.
        flush_seconds: interval at which all recorded data go to the operating system [s], 0.005 to 10. A killed process
            loses at most the messages of this interval and of the write in progress.

    Raises:
        ValueError: a value is out of range.
    """

    max_bytes: int = 64 << 20
    back_pressure: BackPressure = BackPressure.DROP
    block_seconds: float = 1.0
    flush_seconds: float = 0.04

    def __post_init__(self) -> None:
        if self.max_bytes < 1 << 20:
            raise ValueError(f"max_bytes is {self.max_bytes} B; allowed: {1 << 20} or more")
        if not self.block_seconds >= 0:
            raise ValueError(f"block_seconds is {self.block_seconds} s; allowed: 0 or more")
        if not 0.005 <= self.flush_seconds <= 10:
            raise ValueError(f"flush_seconds is {self.flush_seconds} s; allowed: 0.005 to 10")

# SPDX-License-Identifier: Apache-2.0
"""The thread that publishes and records steps while the next one is being solved."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable

from gdfe_ros.node.step import Step
from gdfe_ros.threads import COURIER, show_name

_WAITING = 2
"""Steps that may wait to be published before the stepping is held back."""


class Courier:
    """Hands steps on in order, in a thread of its own.

    Args:
        handle: publishes and records one step.
        failed: called in the thread with the first exception; later steps are dropped.

    Attributes:
        spent: wall time spent on publishing and recording so far [s].
    """

    def __init__(self, handle: Callable[[Step], None], failed: Callable[[Exception], None]) -> None:
        self._handle, self._failed = handle, failed
        self.spent = 0.0
        self._steps: queue.Queue[Step | None] = queue.Queue(maxsize=_WAITING)
        self._thread = threading.Thread(target=self._run, name=COURIER, daemon=True)
        self._thread.start()

    def put(self, step: Step) -> None:
        """Hand over a step; waits while two others wait."""
        self._steps.put(step)

    def flush(self) -> None:
        """Wait until every step that was handed over is published."""
        self._steps.join()

    def stop(self) -> None:
        """Publish what waits and end the thread."""
        self._steps.put(None)
        self._thread.join()

    def _run(self) -> None:
        show_name()
        broken = False
        while (step := self._steps.get()) is not None:
            started = time.perf_counter()
            try:
                if not broken:
                    self._handle(step)
            except Exception as error:
                broken = True
                self._failed(error)
            finally:
                self.spent += time.perf_counter() - started
                self._steps.task_done()

# SPDX-License-Identifier: Apache-2.0
"""A request for several steps; other tasks can run between the steps, and the request can be ended early."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.run import Run
from gdfe_ros.node.stepper import SteppingThread


class Walk:
    """Makes a number of steps; other tasks of the stepper run between two of them.

    Args:
        run: owner of the simulation.
        stepper: thread that makes the steps.
        flush: function that waits until the steps are published.
        count: number of steps.
        told: function that is called after each step with the number of steps made; None: not called.

    Attributes:
        done: number of steps made so far.
    """

    def __init__(
        self,
        run: Run,
        stepper: SteppingThread,
        flush: Callable[[], None],
        count: int,
        told: Callable[[int], None] | None = None,
    ) -> None:
        self._run, self._stepper, self._flush, self._count, self._told = run, stepper, flush, count, told
        self._future: Future[str] = Future()
        self.done = 0

    def __str__(self) -> str:
        return f"{self.done} of {self._count} steps"

    @property
    def going(self) -> bool:
        """Whether steps are still to be made."""
        return not self._future.done()

    def begin(self) -> Future[str]:
        """Queue the first step, and return a ``Future`` of a message with the number of steps and the time."""
        self._post()
        return self._future

    def end(self, reason: BaseException) -> None:
        """End the request after the step in progress, unless it has ended already; the ``Future`` raises ``reason``."""
        with suppress(InvalidStateError):  # it had ended already
            self._future.set_exception(reason)

    def interrupt(self, why: str) -> None:
        """End the request early; the ``Future`` raises a GdfeError whose text begins with ``why``."""
        self.end(GdfeError(f"{why}; {self} were made"))

    def _post(self) -> None:
        def look(step: Future[None]) -> None:
            if (error := step.exception()) is not None:
                self.end(error)

        self._stepper.post(self._step).add_done_callback(look)

    def _step(self) -> None:
        if self._run.ending.is_set():
            self.interrupt("the node is ending")
        if not self.going:
            return
        self._stepper.advance()
        self.done += 1
        if self._told is not None:
            self._told(self.done)
        if self.done < self._count:
            self._post()
            return
        self._flush()
        with suppress(InvalidStateError):  # it was ended during its last step
            self._future.set_result(f"{self._count} steps, time {self._run.simulation.time:.9g} s")

# SPDX-License-Identifier: Apache-2.0
"""Simulations of recordings, in parallel processes with one thread each, or in this process."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager

from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.recording import Recording
from gdfe_ros.fitting.trajectory import NotSimulatedError, Trajectory, simulate
from gdfe_ros.workers import open_workers

Task = tuple[Mapping[str, float], Recording, float]
"""Arguments of one simulation: dict from parameter key to value; the recording; the horizon [s]."""


class Pool:
    """Simulates recordings.

    Args:
        text: YAML text of the scene.
        executor: executor of the processes; None for simulations in this process.

    Attributes:
        count: number of simulations so far.
    """

    def __init__(self, text: str, executor: ProcessPoolExecutor | None = None) -> None:
        self._text, self._executor = text, executor
        self.count = 0

    def run(self, tasks: Sequence[Task]) -> list[Trajectory | NotSimulatedError]:
        """Return the trajectory of each task, or the error that prevented it.

        Raises:
            GdfeError: a process died.
        """
        self.count += len(tasks)
        if self._executor is None or len(tasks) < 2:
            return [_simulate(self._text, task) for task in tasks]
        try:
            return list(self._executor.map(_simulate, [self._text] * len(tasks), tasks))
        except BrokenProcessPool as error:
            raise GdfeError(f"a worker died: {error}; remedy: fewer --workers, they share the memory") from error


@contextmanager
def open_pool(text: str, workers: int) -> Iterator[Pool]:
    """Yield a pool of ``workers`` processes; with one worker, everything runs in this process."""
    if workers < 2:
        yield Pool(text)
        return
    with open_workers(workers) as executor:
        yield Pool(text, executor)


def _simulate(text: str, task: Task) -> Trajectory | NotSimulatedError:
    values, recording, horizon = task
    try:
        return simulate(text, values, recording, horizon=horizon)
    except NotSimulatedError as error:
        return NotSimulatedError(str(error))

# SPDX-License-Identifier: Apache-2.0
"""Values of the last steps, stored for plots."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.live.view import View
from gdfe_ros.scene.scene import Scene

_LENGTH = 4096
"""Number of steps that are stored."""
_AXES = ("x", "y", "z")


class StepHistory:
    """Values of the last steps. One thread adds steps, and another one reads them.

    Args:
        scene: scene of the simulation.

    Attributes:
        curves: dict from a plot's name, its quantity with unit, to the names of its curves.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene, self._lock = scene, threading.Lock()
        self.curves: dict[str, tuple[str, ...]] = {}
        self._rows: NDArray[np.float64] | None = None
        self._count = 0

    def add(self, view: View) -> None:
        """Add a step; if its time is earlier than the last step's, after a reset, clear the history first."""
        groups = list(self._groups(view))
        row = np.array([view.record.time, *(value for _, values in groups for value in values.values())])
        with self._lock:
            if self._rows is None:
                self.curves = {name: tuple(values) for name, values in groups}
                self._rows = np.empty((_LENGTH, len(row)))
            if self._count and row[0] < self._rows[(self._count - 1) % _LENGTH, 0]:
                self._count = 0
            self._rows[self._count % _LENGTH] = row
            self._count += 1

    def table(self, plot: str, *, most: int = 600) -> NDArray[np.float64]:
        """Return the table (1 + c, k) of a plot: a row of times [s], then a row for each of its c curves.

        If more than ``most`` steps are stored, only every second, third, ... step is returned.
        """
        with self._lock:
            names = list(self.curves)
            first = 1 + sum(len(self.curves[name]) for name in names[: names.index(plot)])
            columns = [0, *range(first, first + len(self.curves[plot]))]
            count = min(self._count, _LENGTH)
            order = np.arange(self._count - count, self._count)[:: max(1, -(-count // most))] % _LENGTH
            return self._rows[np.ix_(order, columns)].T.copy()

    def _groups(self, view: View) -> Iterator[tuple[str, dict[str, float]]]:
        record, rest = view.record, self._scene.mesh.vertices
        for name, point in self._scene.probes.items():
            moved = point.at(view.positions)[0] - point.at(rest)[0]
            yield f"{name}: displacement [m]", dict(zip(_AXES, moved, strict=True))
        for name, wrench in view.wrenches.items():
            yield f"{name}: force [N]", dict(zip(_AXES, wrench[:3], strict=True))
            yield f"{name}: moment [N m]", dict(zip(_AXES, wrench[3:], strict=True))
        for name, readings in view.actuators.items():
            for quantity, value, unit in readings:
                yield f"{name}: {quantity} [{unit or 1}]", {quantity: value}
        yield "energy [J]", {"elastic": record.energy, **record.energies}
        yield "least det F [1]", {"least det F": record.min_det}
        yield "iterations of a step [1]", {"iterations": float(record.iterations)}
        yield "time of a step [ms]", {"time": 1e3 * record.wall_time}

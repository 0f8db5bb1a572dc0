# SPDX-License-Identifier: Apache-2.0
"""Growth of cells: it changes the operators of the cells' rest shape, and has no energy of its own.

Let G be the growth and F_e = F G^-1 the elastic part of F. The operators of the cells that grow are replaced by those
of their grown rest shape (`CellType.grown`). The element kernels then compute F_e in place of F.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.actuator import Actuator, ActuatorState, Growth
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.blocks import Operators, in_lanes


class Growths:
    """All growths of a body.

    Args:
        body: the body, whose operators are not modified.
        actuators: actuators of the scene; only growths are used.

    Attributes:
        growths: the growths.
        cells: (k,) cells that can grow.
        ungrown: operators without growth.
    """

    def __init__(self, body: Body, actuators: Sequence[Actuator]) -> None:
        self._body = body
        self.growths = tuple(item for item in actuators if isinstance(item, Growth))
        none = np.zeros(0, dtype=np.intp)
        self.cells = np.unique(np.concatenate([none, *(growth.cells for growth in self.growths)])).astype(np.intp)
        self._rows = [np.searchsorted(self.cells, growth.cells) for growth in self.growths]
        self.ungrown = Operators(body.shape, body.blocks, self._stretch({growth.name: 0.0 for growth in self.growths}))

    def __bool__(self) -> bool:
        """Return whether anything can grow."""
        return bool(self.growths)

    def at(self, commands: Mapping[str, float], last: Operators) -> Operators:
        """Return the operators at these commands; ``last`` itself if they are unchanged."""
        if not self.growths:
            return last
        stretch = self._stretch(commands)
        if np.array_equal(stretch, last.stretch):
            return last
        if np.array_equal(stretch, self.ungrown.stretch):
            return self.ungrown
        kind = self._body.cell_type
        grown, blocks = kind.grown(self._body.shape, self.cells, stretch), self._body.blocks
        return Operators(grown, blocks._replace(geometry=in_lanes(kind.geometry(grown), blocks.element)), stretch)

    def state(self, growth: Growth, commands: Mapping[str, float], grown: Operators) -> ActuatorState:
        """Return the state of a growth: its command and the mean det G of its cells."""
        rows = self._rows[self.growths.index(growth)]
        weights = self._body.shape.volume[self.cells[rows]]
        mean = float(np.average(np.linalg.det(grown.stretch[rows]), weights=weights))
        return ActuatorState(growth.mode, commands[growth.name], mean, 0.0)

    def _stretch(self, commands: Mapping[str, float]) -> NDArray[np.float64]:
        stretch = np.tile(np.eye(3), (len(self.cells), 1, 1))
        for growth, rows in zip(self.growths, self._rows, strict=True):
            stretch[rows] += commands[growth.name] * (growth.stretch - np.eye(3))
        return stretch

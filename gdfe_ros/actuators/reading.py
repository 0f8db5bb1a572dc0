# SPDX-License-Identifier: Apache-2.0
"""Positions of actuators for messages, in the quantities of their commands."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.actuator import Actuator, ActuatorState, Cable, Mode


class Readings:
    """Converts actuator states to positions, in the quantity of each command if this is geometric.

    A position is the shortening or the length of a cable [m], the volume of a chamber [m^3], or the command of a
    growth.

    Args:
        actuators: of a scene.
        rest: (n, 3) undeformed vertices [m].
    """

    def __init__(self, actuators: Iterable[Actuator], rest: NDArray[np.float64]) -> None:
        self._lengths = {
            item.name: float(np.linalg.norm(np.diff(item.points.at(rest), axis=0), axis=1).sum())
            for item in actuators
            if isinstance(item, Cable) and item.mode is Mode.SHORTENING
        }

    def positions(self, states: Mapping[str, ActuatorState]) -> NDArray[np.float64]:
        """Return the position of each of the named states."""
        return np.array([self._position(name, state) for name, state in states.items()])

    def _position(self, name: str, state: ActuatorState) -> float:
        if state.mode is Mode.GROWTH:
            return state.command
        return self._lengths[name] - state.extent if state.mode is Mode.SHORTENING else state.extent

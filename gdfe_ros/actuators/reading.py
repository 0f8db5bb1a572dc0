# SPDX-License-Identifier: Apache-2.0
"""Positions of actuators, for messages."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.actuator import Actuator, ActuatorState, Cable, Mode


class Readings:
    """Converter of actuator states to positions.

    The position of a cable is its shortening [m] if the command is a shortening, else its length [m]. The position of a
    chamber is its volume [m^3], and the position of a growth or a grip is its command.

    Args:
        actuators: actuators of a scene.
        rest: undeformed vertices (n, 3) [m].
    """

    def __init__(self, actuators: Iterable[Actuator], rest: NDArray[np.float64]) -> None:
        self._lengths = {
            item.name: float(np.linalg.norm(np.diff(item.points.at(rest), axis=0), axis=1).sum())
            for item in actuators
            if isinstance(item, Cable) and item.mode is Mode.SHORTENING
        }

    def positions(self, states: Mapping[str, ActuatorState]) -> NDArray[np.float64]:
        """Return the positions (k,) of actuators from a dict from name to state, in the order of the dict."""
        return np.array([self._position(name, state) for name, state in states.items()])

    def _position(self, name: str, state: ActuatorState) -> float:
        if state.mode in (Mode.GROWTH, Mode.GRIP):
            return state.command
        return self._lengths[name] - state.extent if state.mode is Mode.SHORTENING else state.extent

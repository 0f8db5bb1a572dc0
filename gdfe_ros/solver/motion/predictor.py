# SPDX-License-Identifier: Apache-2.0
"""Predicted end of a time step: free flight of the free vertices, and commanded positions of the handles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.measures import least_volume_ratio
from gdfe_ros.solver.equilibrium.predictor import Prediction, Predictor
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.motion.inertia import NAME, kinematics_of
from gdfe_ros.solver.state import State

SHARES = (1.0, 0.5, 0.25, 0.125, 0.0)
"""Fractions of the free flight that are tried in turn until no element is folded. A force on one light vertex may move
it across many cells in a step, and a start with folds ends in another equilibrium. Without handles, the centre of mass
always moves by the whole free flight: the minimisation corrects it only to within the tolerance, and momentum would
change.
"""


class FlightPredictor(Predictor):
    """Predicts the end of a step of one length from a state and its velocities.

    Args:
        body: the discretised body.
        handles: the kinematics of its handles.
        matrix: the constant matrix.
        h: length of the step [s].
        masses: (n,) masses of the vertices [kg].
    """

    def __init__(
        self, body: Body, handles: HandleMotions, matrix: ConstantMatrix, h: float, masses: NDArray[np.float64]
    ) -> None:
        super().__init__(body, handles, matrix)
        self._h = h
        self._shares = np.zeros_like(masses) if body.handles else masses / masses.sum()

    def predict(self, state: State, base: NDArray[np.float64], change: NDArray[np.float64]) -> Prediction:
        """Return the start of a solve that moves the handles from ``state`` to ``base`` (n, 3) [m]."""
        now, h, last, held = kinematics_of(state.terms[NAME]), self._h, state.motion, self._held
        slides, turns = state.slides, state.turns
        if last is not None:
            slides, turns = slides + last.slides, turns + last.turns
        flight = h * now.velocity + 0.5 * h * h * now.acceleration
        drift, flight = self._shares @ flight, flight[self._free]
        led = state.positions.copy()
        led[held] += base[held] - state.base[held]
        for share in (*SHARES, 1.0):  # handles may fold elements whatever the other vertices do
            start = led.copy()
            start[self._free] += share * flight + (1.0 - share) * drift
            if least_volume_ratio(start, self._shape) > 0.0:
                break
        return Prediction(start, slides, turns, 1.0)

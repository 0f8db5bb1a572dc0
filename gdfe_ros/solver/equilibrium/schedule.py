# SPDX-License-Identifier: Apache-2.0
"""Tolerances of the successive minimisations of one solve."""

from __future__ import annotations

import numpy as np

from gdfe_ros.solver.terms.actuation import Actuation

FIRST_TOLERANCE, TIGHTEN = 1e-2, 0.1
"""If multipliers are updated: tolerance of the first minimisation, and factor from each tolerance to the next."""
LINEAR = 1e-4
"""Coarsest tolerance of the last minimisation in statics. Farther from the equilibrium, a step with the tangent does
not measure the distance: the bending stiffness of a sheet or of a hanging bar changes within a thickness.
"""
COARSER = (30.0, 3.0)
"""Tolerances of the first two minimisations, divided by the tolerance that contact forces require
(`Actuation.resolution`). Later minimisations use the required tolerance.
"""
ROUGH = 0.3
"""Lower bound of the tolerance that contact forces require, divided by the self-contact error at the last update."""


class DescentSchedule:
    """Tolerances of the minimisations between which multipliers are updated: coarse at first, the solve's at the end.

    Args:
        actuation: the terms; contact forces may require a finer tolerance.
        tolerance: tolerance of the solve.
        first: tolerance of the first minimisation, without contact forces.
        patient: whether the first minimisation ignores the contact forces, which are those of the last step.

    Attributes:
        present: tolerance of the present minimisation, without contact forces.
    """

    def __init__(self, actuation: Actuation, tolerance: float, *, first: float, patient: bool) -> None:
        self._actuation, self._tolerance, self._patient = actuation, tolerance, patient
        self.present, self._finest, self._count = first, tolerance, 0
        self._rough, self._aim = False, np.inf

    def aim(self, *, confirms: bool) -> float:
        """Return the tolerance of the next minimisation; if it only ``confirms`` the positions, that of the solve."""
        if confirms:
            self._aim = max(self._finest, min(self._tolerance, self._actuation.resolution))
            return self._aim
        coarser = COARSER[self._count] if self._count < len(COARSER) and self.present > self._tolerance else 1.0
        if self._count == 0 and self._patient:
            coarser = np.inf
        self._count += 1
        fine, least = coarser * self._actuation.resolution, ROUGH * self._actuation.missed
        fine, self._rough = max(fine, least), least > fine
        self._aim = min(self.present, fine)
        return self._aim

    @property
    def exact(self) -> bool:
        """Whether the last minimisation had the tolerance of the solve and that of the present contact forces."""
        coarse = self._aim > min(self.present, self._actuation.resolution)
        return self.present <= self._tolerance and not self._rough and not coarse

    def refine(self) -> None:
        """Decrease the tolerance of the solve: multipliers still change, but by too little for another iteration."""
        self._finest *= TIGHTEN

    def tighten(self) -> None:
        """Decrease the tolerance for the next minimisation, at most to that of the solve."""
        self.present = max(self._finest, TIGHTEN * self.present)

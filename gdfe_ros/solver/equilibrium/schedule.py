# SPDX-License-Identifier: Apache-2.0
"""Tolerances of the successive minimisations of one solve."""

from __future__ import annotations

FIRST_TOLERANCE, TIGHTEN = 1e-2, 0.1
"""If multipliers are updated: tolerance of the first minimisation, and factor from each tolerance to the next."""
LINEAR = 1e-4
"""Coarsest tolerance of the last minimisation in statics. Farther from the equilibrium, a step with the tangent does
not measure the distance: the bending stiffness of a sheet or of a hanging bar changes within a thickness.
"""


class DescentSchedule:
    """Tolerances of the minimisations between which multipliers are updated: coarse at first, the solve's at the end.

    Args:
        tolerance: tolerance of the solve.
        first: tolerance of the first minimisation.

    Attributes:
        present: tolerance of the present minimisation.
    """

    def __init__(self, tolerance: float, *, first: float) -> None:
        self._tolerance, self._finest, self._aim, self.present = tolerance, tolerance, first, first

    def aim(self, *, confirms: bool) -> float:
        """Return the tolerance of the next minimisation; if it only ``confirms`` the positions, that of the solve."""
        self._aim = self._tolerance if confirms else self.present
        return self._aim

    @property
    def exact(self) -> bool:
        """Whether the last minimisation had the tolerance of the solve, or a finer one that was asked for."""
        return self.present <= self._tolerance and self._aim <= self.present

    def refine(self) -> None:
        """Decrease the tolerance of the solve: multipliers still change, but by too little for another iteration."""
        self._finest *= TIGHTEN

    def tighten(self) -> None:
        """Decrease the tolerance for the next minimisation, at most to that of the solve."""
        self.present = max(self._finest, TIGHTEN * self.present)

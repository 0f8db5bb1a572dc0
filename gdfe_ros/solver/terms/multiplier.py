# SPDX-License-Identifier: Apache-2.0
"""Multipliers of terms: penalties and extrapolation of commanded lengths and volumes, and all as one vector."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.state import Saved
from gdfe_ros.solver.terms.term import Term

PENALTY = 10.0
"""Penalty stiffness of a commanded length or volume, divided by the stiffness with which the body resists a change of
it. The constant matrix gives this stiffness. The ratio is large enough for few updates. It is small enough to cause
only one outlying eigenvalue, which the history of a minimisation resolves.
"""


PATIENCE, FAINT = 6, 1e-5
"""After this number of updates, the error must be less than the first one. Errors below the fraction `FAINT` of the
body's size do not count.
"""


def wander(errors: Sequence[float], size: float) -> bool:
    """Return whether updates do not settle, from their ``errors`` [m] in a solve and the body's ``size`` [m].

    They go to and fro, or the constraints contradict each other.
    """
    return len(errors) >= PATIENCE and errors[-1] >= max(errors[0], FAINT * size)


def fitted_penalty(matrix: ConstantMatrix, force: NDArray[np.float64], name: str) -> float:
    """Return the penalty of an actuator that acts on the vertices with ``force`` (n, 3) at unit tension or pressure.

    Raises:
        ValueError: the actuator moves nothing; scenes with such an actuator are rejected on loading.
    """
    compliance = matrix.compliance(force)
    if not compliance > 0.0:
        raise ValueError(f"actuator {name!r} moves nothing: everything that it acts on is held by handles")
    return PENALTY / compliance


def remembered(effort: float, saved: Saved) -> Saved:
    """Return the state to store: ``effort`` (tension or pressure) and the previous effort."""
    return {"effort": np.array([effort, saved["effort"][0] if saved else 0.0])}


def followed(saved: Saved, ratio: float) -> float:
    """Return the initial tension or pressure: the last value plus ``ratio`` times the last change."""
    last, before = saved["effort"]
    return float(last + ratio * (last - before))


Array = NDArray[np.float64]


class Multipliers:
    """The multipliers (k,) of all terms, one after another.

    Args:
        terms: the terms of a converged solve.

    Attributes:
        per_metre: (k,) order of magnitude of each multiplier's change per 1 m of displacement.
    """

    def __init__(self, terms: Sequence[Term]) -> None:
        self._terms = terms
        self._ends = np.cumsum([len(term.multipliers) for term in terms])[:-1]
        self.per_metre = self._joined(lambda term: term.per_metre)

    def held(self) -> Array:
        """Return the present multipliers (k,)."""
        return self._joined(lambda term: term.multipliers)

    def hold(self, values: Array) -> None:
        """Set the multipliers (k,)."""
        for term, part in zip(self._terms, np.split(values, self._ends) if self._terms else [], strict=True):
            term.hold(part)

    def updated(self, positions: Array) -> Array:
        """Return the multipliers (k,) after an update at positions (n, 3) [m]; the terms are not modified."""
        return self._joined(lambda term: term.updated(positions))

    def metres(self, values: Array) -> float:
        """Return the largest displacement [m] that corresponds to a change ``values`` (k,) of the multipliers."""
        return float(np.abs(values / self.per_metre).max(initial=0.0))

    def _joined(self, part: Callable[[Term], Array]) -> Array:
        return np.concatenate([np.zeros(0), *(part(term) for term in self._terms)])

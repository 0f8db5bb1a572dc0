# SPDX-License-Identifier: Apache-2.0
"""The multipliers of all terms as one vector."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.terms.term import Term

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

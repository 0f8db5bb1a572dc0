# SPDX-License-Identifier: Apache-2.0
"""A linear solver without a matrix: preconditioned generalised conjugate residuals (Eisenstat, Elman, Schultz 1983)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gdfe_ros.errors import GdfeError
from gdfe_ros.solver.vectors import Array

Map = Callable[[Array], Array]


class ConjugateResiduals:
    """Solves A x = b for several b, one after another.

    Directions d of earlier right-hand sides are stored with their images M^-1 A d. New products are needed only for the
    part of the residual that these images do not span.

    Args:
        product: function that returns A times a vector (k,).
        precondition: function that returns M^-1 times a vector (k,). The closer M is to A, the fewer products are
            needed.
        tolerance: tolerance of the relative residual: the norm of the preconditioned residual, divided by the smaller
            of the norms of M^-1 b and x.
    """

    ROUNDING = 1e-6
    """Lower bound of the solution's norm in the relative residual, divided by the norm of M^-1 b."""
    ENOUGH = 1e-5
    """Relative residual that is accepted if the tolerance cannot be reached, because products are finite differences.
    """
    EXHAUSTED = 1e-13
    """The image of a unit vector counts as not new if its part orthogonal to all stored images has a norm below this.
    """
    STALLED = 0.99
    """The iteration stalls if a direction leaves more than this fraction of the residual's norm. The residual would
    then give nearly the same direction again. The next direction is therefore the last image, as in Arnoldi's method.
    """
    MOST = 150
    """Largest number of products for one right-hand side. If more directions than this are stored, they are deleted
    before the next right-hand side.
    """

    def __init__(self, product: Map, precondition: Map, *, tolerance: float) -> None:
        self._product, self._precondition, self._tolerance = product, precondition, tolerance
        self._known: list[tuple[Array, Array]] = []

    def solve(self, right: Array) -> Array:
        """Return x (k,) of A x = b.

        Raises:
            GdfeError: A is singular, or nearly so: there is no derivative.
        """
        residual, answer = self._precondition(right), np.zeros_like(right)
        size, best, count = float(np.linalg.norm(residual)), np.inf, 0
        if len(self._known) > self.MOST:
            self._known.clear()
        for known in self._known:
            _reduce(residual, answer, *known)
        stalled, left = False, _relative_residual(residual, answer, size)
        while left > self._tolerance and not (left < self.ENOUGH and left > 0.5 * best):
            if count == self.MOST or not self._extend(self._known[-1][1] if stalled else residual):
                break
            best, before = min(best, left), float(np.linalg.norm(residual))
            _reduce(residual, answer, *self._known[-1])
            stalled = float(np.linalg.norm(residual)) > self.STALLED * before
            left, count = _relative_residual(residual, answer, size), count + 1
        if not left < self.ENOUGH:
            raise GdfeError(
                f"no derivative exists here, or none is known: the tangent is singular (residual {left:.2g} after "
                f"{count} products); remedy: step away from the edge of stability"
            )
        return answer

    def _extend(self, vector: Array) -> bool:
        """Store ``vector`` as a direction, with an image orthogonal to all stored images; return whether it is new."""
        back = -vector / np.linalg.norm(vector)
        image = self._precondition(self._product(-back))
        for _ in range(2):  # a single pass leaves rounding, which matters if the matrix is close to the preconditioner
            for known in self._known:
                _reduce(image, back, *known)
        length = float(np.linalg.norm(image))
        if not length > self.EXHAUSTED:
            return False
        self._known.append((-back / length, image / length))
        return True


def _reduce(residual: Array, answer: Array, direction: Array, image: Array) -> None:
    """Subtract from the residual its part along ``image``; add the same multiple of ``direction`` to the answer."""
    share = float(image @ residual)
    residual -= share * image
    answer += share * direction


def _relative_residual(residual: Array, answer: Array, size: float) -> float:
    """Return the relative residual; 0 for a right-hand side of zero."""
    # A stiff constraint makes the right-hand side far larger than the solution, whose accuracy matters.
    scale = min(size, max(float(np.linalg.norm(answer)), ConjugateResiduals.ROUNDING * size))
    return float(np.linalg.norm(residual)) / scale if size > 0.0 else 0.0

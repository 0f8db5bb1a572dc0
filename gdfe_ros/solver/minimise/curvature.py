# SPDX-License-Identifier: Apache-2.0
"""Products with the present tangent, and its softest direction by the preconditioned Lanczos method.

Products are finite differences of the gradient. K is the tangent. M is a positive definite preconditioner; only
products with its inverse are needed. The least eigenvalue of M^-1 K has the sign of the least eigenvalue of K. The
closer M is to K, the fewer products are needed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh_tridiagonal

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.descent.lbfgs_workspace import allocate
from gdfe_ros.solver.descent.search import advance
from gdfe_ros.solver.minimise.minimiser import Task
from gdfe_ros.solver.vectors import Array, largest


class TangentProducts:
    """Multiplies the tangent K of elements and terms by directions, in a workspace of its own.

    Args:
        body: the discretised body.
    """

    SPACING = 1e-7
    """Largest displacement in a finite difference, divided by the body's size. If a displacement of a tenth of the
    body's size changes the stiffness of the body by 100 %, the truncation error is a millionth of the product. The
    rounding error is smaller.
    """

    def __init__(self, body: Body) -> None:
        self._beside = allocate(body.unknowns.rows, body.rest, body.cells.shape, memory=0)
        self._spacing = self.SPACING * body.size

    def begin(self, task: Task) -> None:
        """Let further products use the tangent at the unknowns of ``task``, which is not modified."""
        work = task.active.workspace
        self._problem, self._u, self._gradient = task.problem, work.u.copy(), work.gradient.copy()
        self._beside.x[...] = work.x

    @property
    def positions(self) -> Array:
        """Positions (n, 3) [m] of the last evaluation, overwritten by the next one."""
        return self._beside.x

    def energy(self, step: Array) -> float:
        """Return the energy [J] of all terms at the unknowns plus ``step`` (3 r,)."""
        self._beside.u[...] = self._u + step
        advance(self._problem, self._beside, True)
        return float(self._beside.status[0]["energy"])

    def __call__(self, direction: Array) -> Array:
        """Return the product K d (3 r,) [N] of the tangent and a ``direction`` d (3 r,)."""
        step = self._spacing / largest(direction)
        self._beside.u[...] = self._u + step * direction
        advance(self._problem, self._beside, True)
        return (self._beside.gradient - self._gradient) / step


Apply = Callable[[Array, Array], None]
Product = Callable[[Array], Array]


class Lowest(NamedTuple):
    """Result of the Lanczos method.

    Attributes:
        value: least Ritz value of M^-1 K.
        direction: (3 r,) Ritz vector [m] of this value, with M-norm 1.
        known: whether the value has converged to the least eigenvalue.
    """

    value: float
    direction: Array
    known: bool


@dataclass(frozen=True, kw_only=True)
class Lanczos:
    """The preconditioned Lanczos method.

    Vectors are not reorthogonalised; the loss of orthogonality only repeats converged values.

    Attributes:
        most: largest number of products; without convergence by then, the least eigenvalue counts as unknown.
        least: least number of products before a Ritz value can count as converged.
        look_back: number of products between two computations of the least Ritz value.
        steady, flat: the least Ritz value has converged if its last change was at most the fraction ``steady`` of its
            magnitude, or at most ``flat``. A magnitude below ``flat`` counts as zero curvature.
        noise: the next Lanczos vector counts as noise of the finite differences if its M-norm, divided by the largest
            diagonal entry, is below this.
    """

    most: int = 80
    least: int = 12
    look_back: int = 4
    steady: float = 0.05
    flat: float = 1e-4
    noise: float = 1e-4

    def lowest(self, product: Product, precondition: Apply, load: Array) -> Lowest:
        """Return the least Ritz value of M^-1 K and its vector.

        Args:
            product: multiplies the tangent K by a direction (3 r,).
            precondition: writes M^-1 times its first argument to its second.
            load: (3 r,) M times the start vector, which must contain every mode.
        """
        vector, before = np.empty_like(load), np.zeros_like(load)
        precondition(load, vector)
        weight = float(load @ vector)
        vectors = np.empty((self.most, len(load)), np.float32)  # pages never written use no memory
        diagonal: list[float] = []
        beside: list[float] = []
        value, known = np.inf, not weight > 0.0
        while weight > 0.0 and len(diagonal) < self.most:
            scale = 1.0 / np.sqrt(weight)
            vector, load = scale * vector, scale * load
            vectors[len(diagonal)] = vector
            image = product(vector)
            diagonal.append(float(vector @ image))
            if len(diagonal) % self.look_back == 0:
                last, value = value, _least(diagonal, beside)[0]
                known = len(diagonal) >= self.least and last - value <= max(self.steady * abs(value), self.flat)
                if known:
                    break
            load, before = image - diagonal[-1] * load - (beside[-1] if beside else 0.0) * before, load
            precondition(load, vector)
            weight = float(load @ vector)
            known = not weight > (self.noise * float(np.abs(diagonal).max())) ** 2
            if known:  # the vectors span the whole Krylov space
                break
            beside.append(np.sqrt(weight))
        if not diagonal:
            return Lowest(1.0, np.zeros_like(load), True)
        value, coefficients = _least(diagonal, beside[: len(diagonal) - 1])
        return Lowest(value, coefficients @ vectors[: len(diagonal)], known)


def _least(diagonal: list[float], beside: list[float]) -> tuple[float, Array]:
    """Return the least eigenvalue of a symmetric tridiagonal matrix, and its eigenvector."""
    values, vectors = eigh_tridiagonal(np.array(diagonal), np.array(beside), select="i", select_range=(0, 0))
    return float(values[0]), vectors[:, 0]

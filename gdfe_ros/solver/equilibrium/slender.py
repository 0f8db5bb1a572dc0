# SPDX-License-Identifier: Apache-2.0
"""Choice of the tangent preconditioner for slender bodies, whose soft modes the constant matrix makes too stiff."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.faces import vertex_pieces
from gdfe_ros.solver.descent.active_set import ActiveSet
from gdfe_ros.solver.descent.products import TangentProducts
from gdfe_ros.solver.descent.tangent import TangentMinimiser
from gdfe_ros.solver.equilibrium.model import Model
from gdfe_ros.solver.equilibrium.solve import Solve
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.state import State
from gdfe_ros.solver.tangent.curvature import lowest
from gdfe_ros.solver.tangent.level import TangentLevel
from gdfe_ros.solver.tangent.smooth_field import smooth_field

PRODUCTS = 40
"""Number of Lanczos steps. The softness of a body is the least eigenvalue of the tangent relative to the constant
matrix. From a smooth start, these steps give the softness of a slender body within a factor of ten, enough to
distinguish it from a stocky body; docs/theory/solve.md has the figures.
"""
SLENDER = 1.5e-3
"""A body counts as slender if its softness after 40 Lanczos steps is below this; steps of the constant matrix alone are
then too short. The softness of stocky scenes is 3.9e-3 to 8.4e-3, of a bar six times as long as thick 8e-4, and of the
robots 2e-4 to 1e-3.
"""
SLENDER_IN_MOTION = 2e-2
"""The limit `SLENDER` for bodies with inertia. In motion a tangent need not certify a distance, and saves time for more
bodies.
"""
MECHANISM = 1e-10
"""A mode of smaller softness counts as rigid: the handles let the body turn or move as a whole."""
ROUGH = 1e-4
"""The factor of a held body without contact is kept in single precision. If the body's softness is at least this, it is
computed in single precision, too. Errors of a computed factor grow with the condition number of the tangent, those of a
factor that is only kept so with its square root: a solve of a softer body, a fork of softness 2e-5, ended 450
tolerances from the equilibrium with the former. Double precision conserves the momentum of free bodies, and finds
equilibria of contacts on the point of slip.
"""
INVERSE_ITERATIONS = 6
"""Number of inverse iterations with the tangent's factor; they determine the softness to within a tenth."""


def for_slender(
    model: Model,
    whole: ActiveSet,
    matrix: ConstantMatrix,
    rest: State,
    weight: NDArray[np.float64],
    bending: NDArray[np.float64],
    *,
    threads: int | None,
    moving: bool = False,
) -> Model:
    """Return the model with a tangent preconditioner if the body needs one; otherwise the model itself.

    Args:
        model: model of the body without a tangent preconditioner.
        whole: the active set of the whole body.
        matrix: the constant matrix.
        rest: the undeformed state.
        weight: (m,) weights of the elements in the constant matrix [Pa].
        bending: (m,) hourglass stiffnesses of the elements in the constant matrix [N/m].
        threads: number of threads among which the elements are divided.
        moving: whether inertia is among the terms.
    """
    body, count = model.body, len(whole.unknowns.free)
    if count == 0:
        return model
    task = Solve.at(model, rest).evaluate(whole, matrix.coupling, threads=threads)
    product, field = TangentProducts(body), np.zeros((whole.unknowns.rows, 3))
    field[:count] = smooth_field(body.rest, vertex_pieces(body.cells, len(body.rest)))[whole.unknowns.free]
    product.begin(task)
    seen = lowest(product, task.precondition, _weighed(matrix, field, count), most=PRODUCTS, steady=0.0)
    load = _weighed(matrix, seen.direction.reshape(-1, 3), count)
    model = replace(model, softest=load)
    if seen.value >= (SLENDER_IN_MOTION if moving else SLENDER):
        return model
    level, work = TangentLevel(body, matrix.assembled, model.actuation.terms), whole.workspace
    if level.take(task.problem, work.u, work.x).shift > 0.0:
        return model
    for _ in range(INVERSE_ITERATIONS):
        found = np.empty_like(load)
        level.solve(load, found)
        least = float(found @ load) / float(found @ _weighed(matrix, found.reshape(-1, 3), count))
        load = _weighed(matrix, found.reshape(-1, 3) / np.abs(found).max(), count)
    if least < MECHANISM:
        return model
    level.first_shift = least
    held = body.handles and not body.unknowns.rigid_rows
    if held and not model.actuation.contacts:
        level.shorten(computed=least >= ROUGH)
    minimiser = TangentMinimiser(body, weight, bending, level, moving=moving)
    return replace(model, minimiser=minimiser, level=level, softest=load)


def _weighed(matrix: ConstantMatrix, field: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the constant matrix times a field (r, 3) of the unknowns, as (3 r,); rows of handles are zero."""
    return np.concatenate([matrix.multiply(field[:count]).ravel(), np.zeros(3 * (len(field) - count))])

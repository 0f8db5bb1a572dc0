# SPDX-License-Identifier: Apache-2.0
"""Compiled arcs of Newton steps: elements rotate by finite angles instead of stretching.

A Newton step d is linear. In an element with the deformation gradient F, its displacement gradient is (W + S) F with
the infinitesimal rotation W and the strain S. If the element rotates by the angle w, d also lengthens it by w^2 / 2.
The stiff directions of a slender body then allow only short steps. The step therefore follows the arc

    x(t) = x + t d + t^2 c,

whose direction at t = 0 is d. At t = 1 the elements' desired deformation gradients are exp(W) (I + S) F. As in the
global step of the paper, the constant matrix A fits the vertices to these gradients. With weights w_e, volumes V_e and
gradients g_e,

    A c = sum_e w_e V_e (exp(W) (I + S) F - F - (W + S) F) g_e .
"""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined, internal, kernel
from gdfe_ros.materials.tensor import cofactor, determinant, times
from gdfe_ros.solver.elements.corners import mean_gradient
from gdfe_ros.solver.matrix.rotation import rotation_matrix
from gdfe_ros.solver.matrix.substitution import apply_free
from gdfe_ros.solver.matrix.unknowns import clear_fixed, gather_rows, place
from gdfe_ros.solver.vectors import largest

MOST_TURN = 0.2
"""Largest rotation of an element in a Newton step [rad]; longer steps are shortened. With 0.3 and more, some steps of
robots with contact end at other equilibria and are repeated.
"""


@inlined
def decompose_motion(x, end, shape, e):
    """Return F (9,) of element ``e`` at ``end`` (n, 3) [m], the columns of (I + S) F, and the rotation vector of W.

    The F in (I + S) F is that at ``x`` (n, 3) [m]. W and S are the rotation and the strain from ``x`` to ``end``; they
    are zero if the element is inverted at ``x``.
    """
    f, g = mean_gradient(x, shape, e), mean_gradient(end, shape, e)
    c = cofactor(f)
    j = determinant(f, c)
    r = 1.0 / j if j > 0.0 else 0.0
    # (W + S) = (G - F) F^-1 = (G - F) cof(F)^T / J
    a, b = times(c, (g[0] - f[0], g[1] - f[1], g[2] - f[2])), times(c, (g[3] - f[3], g[4] - f[4], g[5] - f[5]))
    d = times(c, (g[6] - f[6], g[7] - f[7], g[8] - f[8]))
    s1, s2, s5 = 0.5 * r * (a[1] + b[0]), 0.5 * r * (a[2] + d[0]), 0.5 * r * (b[2] + d[1])
    m = (1.0 + r * a[0], s1, s2, s1, 1.0 + r * b[1], s5, s2, s5, 1.0 + r * d[2])
    p, q, s = times(m, (f[0], f[3], f[6])), times(m, (f[1], f[4], f[7])), times(m, (f[2], f[5], f[8]))
    turn = 0.5 * r * (d[1] - b[2]), 0.5 * r * (a[2] - d[0]), 0.5 * r * (b[0] - a[1])
    return g, (p, q, s), turn


@internal
def pull_to_arc(x, end, shape, weight, force):
    """Write the right-hand side of the equation for c (see the module) to ``force`` (m, c, 3) [N].

    The step leads from ``x`` to ``end`` (n, 3) [m].

    Return the largest rotation [rad] of an element, to first order.
    """
    most = 0.0
    for e in range(len(shape.cells)):
        g, (p, q, s), turn = decompose_motion(x, end, shape, e)
        most = max(most, turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2])
        r, scale = rotation_matrix(turn), weight[e] * shape.volume[e]
        # The columns of exp(W) (I + S) F
        p, q, s = times(r, p), times(r, q), times(r, s)
        for corner in range(shape.cells.shape[1]):
            g0, g1, g2 = shape.gradient[e, corner, 0], shape.gradient[e, corner, 1], shape.gradient[e, corner, 2]
            for i in range(3):
                pull = (p[i] - g[3 * i]) * g0 + (q[i] - g[3 * i + 1]) * g1 + (s[i] - g[3 * i + 2]) * g2
                force[e, corner, i] = scale * pull
    return math.sqrt(most)


@internal
def place_and_pull(problem, work, metric):
    """Do `pull_to_arc` for the step in ``work.direction``; its end is written to ``metric.x``."""
    for n in range(len(work.u)):
        metric.u[n] = work.u[n] + work.direction[n]
    place(metric.u, problem.frame, problem.unknowns, metric.x)
    return pull_to_arc(work.x, metric.x, problem.shape, metric.weight, metric.force)


@internal
def follow_arc(problem, work, metric):
    """Shorten the step d in ``work.direction`` to rotations of at most `MOST_TURN`, and write c to ``work.curve``.

    Slope and length of the step in ``work.status`` are updated. ``metric`` has the constant matrix and scratch arrays.
    """
    x, status, free = metric.x, work.status[0], 3 * len(problem.unknowns.free)
    for i in range(len(x)):
        for axis in range(3):
            x[i, axis] = work.x[i, axis]
    turn = place_and_pull(problem, work, metric)
    if turn > MOST_TURN:
        share = MOST_TURN / turn
        for n in range(len(work.u)):
            work.direction[n] *= share
        status.slope *= share
        place_and_pull(problem, work, metric)
    gather_rows(metric.force, problem.unknowns, metric.gradient)
    apply_free(metric.coupling.inverse, metric.gradient, work.curve)
    clear_fixed(problem.unknowns.fixed, work.curve)
    for n in range(free, len(work.u)):
        work.curve[n] = 0.0
    status.step = largest(work.direction) + largest(work.curve)


@kernel
def follow_arc_once(problem, work, metric):
    """Do `follow_arc` for a caller in Python. It takes a second to compile, and few bodies need it."""
    follow_arc(problem, work, metric)

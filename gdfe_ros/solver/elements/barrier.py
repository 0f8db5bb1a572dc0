# SPDX-License-Identifier: Apache-2.0
"""Compiled fold barrier: an energy of each corner's volume ratio that keeps corners of elements from folding.

The energy of a hexahedron depends on its mean deformation gradient and its hourglass vectors. This energy stays finite
when a corner has no volume left, so that an impact or a pressing obstacle may fold the corner. The barrier adds, for
each corner c of each element with n corners,

    E_c = w mu V/n b(s),   s = J_c / J_0,   b(s) = (1 - s)^3 / s for s < 1, else 0            [J]

with the corner's volume ratio J_c, the threshold J_0, the weight w, the element's shear modulus mu [Pa] and volume V
[m^3]. Its properties are:

1. J_c = r_c a . (b x c) is trilinear in the corner's three edges a, b, c [m]. Here 1 / r_c [m^3] is the undeformed
   triple product. Therefore dJ_c/da = r_c b x c, and cyclically.
2. b, b' and b'' are zero at s = 1. The energy stays twice differentiable, and nothing changes above the threshold.
3. The force that opens the corner grows without bound as s goes to 0: b' = -(1 - s)^2 (1 + 2 s) / s^2.
4. Below s_0 the energy continues as its tangent at s_0, so that it is finite everywhere. A line search whose step is
   too long then has an energy to interpolate. A body that starts with folds is pushed open. (A parabola would push too
   hard: the first step of such a body would run away.)

The corners of a cut cell are the corners of the box that its material fills. Barriers are evaluated only for elements
near folding (see `watch`). Bodies without such elements have no extra cost.
"""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import inlined, internal
from gdfe_ros.materials.table import SHEAR
from gdfe_ros.mesh.quality import list_ids
from gdfe_ros.mesh.triples import combine, corner, cross, dot
from gdfe_ros.solver.elements.cell_type import add_slopes, load_points
from gdfe_ros.solver.elements.hexahedra import SIDES
from gdfe_ros.solver.vectors import Array

THRESHOLD = 0.2
"""Threshold J_0. A value of 0.3 would act in sound scenes: the least volume ratios of a corner are 0.256 in
tensile_curve and 0.241 in two_material_bar.
"""
WEIGHT = 3.0
"""Weight w. The height of a body after a bounce changes by at most 1.2 % for w from 1 to 10, J_0 from 0.1 to 0.4."""
LINE = 0.1
"""Ratio s_0 = J_c / J_0 below which the energy continues as a straight line."""
NEARLY_FOLDED = 2.0 * THRESHOLD
"""An element is watched if the volume ratio of a corner is below this."""


_CODES, _BITS = SIDES @ (1, 2, 4), np.array((1, 2, 4))
_HIGH, _LOW = (np.argsort(_CODES)[codes] for codes in (_CODES[:, None] | _BITS, _CODES[:, None] & ~_BITS))
HEX_EDGES = np.stack([_HIGH, _LOW, _LOW], axis=2).astype(np.int32)
"""Corners (8, 3, 3) of the three edges, along xi, eta and zeta, that meet in each corner: the edge's last corner, its
first corner, and its first corner again (with weight 0, see `HEX_WEIGHTS`).
"""
TET_EDGES = np.array(
    [
        [[4, 1, 0], [6, 2, 0], [7, 3, 0]],
        [[5, 2, 1], [4, 0, 1], [8, 3, 1]],
        [[6, 0, 2], [5, 1, 2], [9, 3, 2]],
        [[8, 1, 3], [7, 0, 3], [9, 2, 3]],
    ],
    dtype=np.int32,
)
"""Nodes (4, 3, 3) of the three edges, in right-handed order, that meet in each corner c: the middle node ck, the other
end k, and c. The edge's slope at c is dx/dL_k - dx/dL_c = 4 x_ck - x_k - 3 x_c.
"""
HEX_WEIGHTS, TET_WEIGHTS = (1.0, -1.0, 0.0), (4.0, -1.0, -3.0)
"""Weights, in the vector of an edge, of the three points that `HEX_EDGES` or `TET_EDGES` lists for it."""


@inlined
def wall(s):
    """Return b(s) and b'(s) for s < 1, with the straight line below `LINE`."""
    t = max(s, LINE)
    rest = 1.0 - t
    value, slope = rest * rest * rest / t, -rest * rest * (1.0 + 2.0 * t) / (t * t)
    value += slope * (s - t)
    return value, slope


@inlined
def edge_at(points, c, k):
    """Return the vector (3,) [m] of edge ``k`` at corner ``c`` of a cell with ``points`` (n, 3) [m]."""
    i, j, m = HEX_EDGES[c, k] if len(points) == 8 else TET_EDGES[c, k]
    u, v, w = HEX_WEIGHTS if len(points) == 8 else TET_WEIGHTS
    return combine(u, corner(points, i), v, corner(points, j), w, corner(points, m))


@inlined
def add_edge(slopes, c, k, share, derivative):
    """Convert ``share`` times the ``derivative`` (3,) by an edge to derivatives by points; add them to ``slopes``."""
    nodes, weights = (HEX_EDGES[c, k], HEX_WEIGHTS) if len(slopes) == 8 else (TET_EDGES[c, k], TET_WEIGHTS)
    for a in range(3):
        for i in range(3):
            slopes[nodes[a], i] += weights[a] * share * derivative[i]


@inlined
def edges_at(points, shape, e, c):
    """Return the volume ratio det F at corner ``c`` of element ``e``, and the three edges [m] there."""
    a, b, d = edge_at(points, c, 0), edge_at(points, c, 1), edge_at(points, c, 2)
    return shape.corner_ratio[e, c] * dot(a, cross(b, d)), a, b, d


@inlined
def corner_ratios_at(x, shape, e, points):
    """Return the least and the mean volume ratio det F at the corners of element ``e``; ``points`` (n, 3) is scratch.

    The least one is NaN if one of the ratios is NaN. A folded corner does not show in the mean deformation gradient,
    because hourglass patterns do not contribute to this gradient.
    """
    load_points(x, shape, e, points)
    least, total, corners = math.inf, 0.0, shape.corner_ratio.shape[1]
    for c in range(corners):
        ratio = edges_at(points, shape, e, c)[0]
        least, total = min(least, ratio), total + ratio
    return least if math.isfinite(total) else math.nan, total / corners


@inlined
def room(x, shape, e, points):
    """Return the distance [m] that vertices may move before a corner of element ``e`` can reach the barrier.

    It is 0 if the element is nearly folded. The module `gdfe_ros.solver.elements.response` derives the bound. If no
    vertex moves by more than d, edges change by up to 2 d, or by 8 d in quadratic cells. ``points`` (n, 3) is scratch.
    """
    load_points(x, shape, e, points)
    found = math.inf
    for c in range(shape.corner_ratio.shape[1]):
        ratio, a, b, d = edges_at(points, shape, e, c)
        if not ratio >= NEARLY_FOLDED:
            return 0.0
        first, second, third = math.sqrt(dot(a, a)), math.sqrt(dot(b, b)), math.sqrt(dot(d, d))
        share = 3.0 * shape.corner_ratio[e, c] * (first * second + second * third + third * first)
        found = min(found, min(min(first, second), min(third, (ratio - THRESHOLD) / share)))
    return found / (2.0 if len(points) == 8 else 8.0)


@internal
def add_walls(x, watched, shape, material, table, force, energy):
    """Add the fold barriers of the ``watched`` elements (k,) to node forces (m, c, 3) [N] and energies (m,) [J]."""
    corners, nodes = shape.corner_ratio.shape[1], shape.cells.shape[1]
    points, slopes = np.empty((nodes, 3)), np.empty((nodes, 3))
    for e in watched:
        load_points(x, shape, e, points)
        slopes[...] = 0.0
        scale = WEIGHT / corners * shape.volume[e] * table.parameters[material[e], SHEAR]
        pressed = False
        for c in range(corners):
            ratio, a, b, d = edges_at(points, shape, e, c)
            if not ratio < THRESHOLD:
                continue
            pressed = True
            value, slope = wall(ratio / THRESHOLD)
            energy[e] += scale * value
            slope *= scale * shape.corner_ratio[e, c] / THRESHOLD
            add_edge(slopes, c, 0, slope, cross(b, d))
            add_edge(slopes, c, 1, slope, cross(d, a))
            add_edge(slopes, c, 2, slope, cross(a, b))
        if pressed:
            add_slopes(slopes, shape, e, force)


def tell_flat(least: Array) -> str:
    """Return a message that lists the flat or folded elements; empty if there are none.

    Args:
        least: (m,) least volume ratio at a corner of each element.
    """
    folded, flat = np.flatnonzero(~(least > 0.0)), np.flatnonzero(least < THRESHOLD)
    found = folded if len(folded) else flat[np.argsort(least[flat], kind="stable")]
    if not len(found):
        return ""
    what = "folded or turned inside out" if len(folded) else "pressed flat at a corner"
    return f"elements {what} (least volume ratio {least[found].min():.3g}): {list_ids(found)}"

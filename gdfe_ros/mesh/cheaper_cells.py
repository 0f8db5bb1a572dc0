# SPDX-License-Identifier: Apache-2.0
"""Bodies that hexahedra fill regularly, where tetrahedra would cost several times as much."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

ACROSS = 4
"""Hexahedra across the thinnest part. A clamped bar with these is 1.4 % too stiff (test/solver/tetrahedra)."""
COST = 2.0
"""Time for a tetrahedron of second order divided by that for a hexahedron (docs/theory/tetrahedra.md)."""
CHEAPER = 4.0
"""Least ratio of the costs for a remark."""
FLAT = 1e-6
"""Largest component of a normal that counts as zero, and distance of equal planes divided by the body's size."""


def volume_inside(vertices: NDArray[np.float64], triangles: NDArray[np.integer]) -> float:
    """Return the volume [m^3] inside a closed surface (n, 3) [m], (t, 3)."""
    a, b, c = np.moveaxis(vertices[triangles] - vertices.mean(axis=0), 1, 0)
    return abs(float(np.einsum("ti,ti->", a, np.cross(b, c)))) / 6.0


def cheaper_hexahedra(
    vertices: NDArray[np.float64], triangles: NDArray[np.integer], *, tetrahedra: float, thinnest: float
) -> list[str]:
    """Return a list with a remark if regular hexahedra fill a body at a fraction of the cost; empty if not.

    A body qualifies if it is a box, if all its faces are parallel to the planes of the axes, or if it is extruded along
    an axis: each face is parallel to the axis, or lies in one of two planes across it.

    Args:
        vertices: positions [m], shape (n, 3).
        triangles: vertex ids of the closed surface, shape (t, 3).
        tetrahedra: number of tetrahedra, or their expected number.
        thinnest: least thickness of a wall [m].
    """
    corners = vertices[triangles]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(areas, axis=1)
    solid = lengths > 0.0
    corners, normals = corners[solid], np.abs(areas[solid] / lengths[solid, None])
    volume = volume_inside(vertices, triangles)
    low, high = corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)
    edge = thinnest / ACROSS
    if not np.isfinite(edge) or not edge > 0.0 or COST * tetrahedra < CHEAPER * volume / edge**3:
        return []
    shape, remedy = _shape(corners, normals, high - low, volume, edge)
    if not shape:
        return []
    ratio = COST * tetrahedra / (volume / edge**3)
    return [
        f"the body is {shape}. With {ACROSS} hexahedra across its thinnest part, a step would cost about {ratio:.0f} "
        f"times less than with {tetrahedra:.0f} tetrahedra; a clamped bar is 1.4 % too stiff then; remedy: {remedy}"
    ]


def _shape(
    corners: NDArray[np.float64], normals: NDArray[np.float64], extent: NDArray[np.float64], volume: float, edge: float
) -> tuple[str, str]:
    """Return words for a regular shape, and how to mesh it; two empty texts if the shape is another one."""
    size = ", ".join(f"{length:.4g}" for length in extent)
    cells = ", ".join(str(max(1, round(length / edge))) for length in extent)
    bar = f"`mesh: {{bar: {{size: [{size}], cells: [{cells}]}}}}`"
    if (normals.max(axis=1) > 1.0 - FLAT).all():
        if volume > (1.0 - FLAT) * extent.prod():
            return "a box", bar
        return "bounded by planes across the axes", f"{bar} with the missing boxes in `cut`"
    for axis, name in enumerate("xyz"):
        along, across = normals[:, axis] < FLAT, normals[:, axis] > 1.0 - FLAT
        planes = corners[across, :, axis]
        ends = np.minimum(np.abs(planes - corners[..., axis].min()), np.abs(planes - corners[..., axis].max()))
        if (along | across).all() and ends.max(initial=0.0) < FLAT * extent.max():
            return f"extruded along {name}", (
                "quadrilaterals in its profile, extruded into hexahedra (gmsh: Recombine Surface, Extrude with "
                "Layers), as `mesh: {file: ...}`"
            )
    return "", ""

# SPDX-License-Identifier: Apache-2.0
"""Self-intersections of a surface: which of its triangles cut each other, and where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.box_tree import BoxTree

TOUCH = 1e-6
"""Length up to which triangles touch and do not cut each other, divided by the diagonal of the surface. The single
precision of STL files moves vertices by 1e-7."""
LISTED = 3
"""Number of places that are named."""


@dataclass(frozen=True, eq=False)
class SelfCuts:
    """The self-intersections of a surface.

    Attributes:
        pairs: number of pairs of triangles that cut each other, or overlap in one plane.
        cut: (t,) bool, whether another triangle cuts the triangle.
        places: (k, 3) [m], a place of an intersection for each of the k triangles that are cut, in ascending order.
    """

    pairs: int
    cut: NDArray[np.bool_]
    places: NDArray[np.float64]

    @property
    def defects(self) -> list[str]:
        """A list with the text of the defect; empty if there are no self-intersections."""
        if self.pairs == 0:
            return []
        some = self.places[_far_apart(self.places, LISTED)]
        where = ", ".join(f"({x:.4g}, {y:.4g}, {z:.4g})" for x, y, z in some)
        return [
            f"the surface cuts itself: {self.pairs} pairs of its triangles cut each other or lie on each other, e.g. "
            f"near {where} m; remedy: unite overlapping parts in the CAD program (Boolean union; Blender: 3D-Print "
            "toolbox, Make Manifold). `mesh: {tets: ...}` accepts the surface and fills what it winds around"
        ]


def find_self_cuts(vertices: NDArray[np.float64], triangles: NDArray[np.integer], *, touch: float = TOUCH) -> SelfCuts:
    """Return the self-intersections of a surface.

    Two triangles cut each other if their common line is longer than ``touch`` times the diagonal and runs through the
    interior of at least one of them. Two triangles in one plane overlap if no edge separates them. Triangles that only
    share a corner or an edge do neither.

    Args:
        vertices: positions [m], shape (n, 3).
        triangles: vertex ids, shape (t, 3).
        touch: length up to which triangles touch, divided by the diagonal of the surface.
    """
    from gdfe_ros.mesh.triangle_kernels import count_cuts  # loads numba

    tolerance = touch * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    tree = BoxTree.of(vertices, triangles, flat=touch)
    counts, places = np.empty(len(tree.order), dtype=np.int64), np.zeros((len(tree.order), 3))
    count_cuts(tree.corners, tree.normals, tree.boxes, tolerance, counts, places)
    cut, ranked = np.zeros(len(triangles), dtype=bool), np.argsort(tree.order)
    cut[tree.order] = counts > 0
    return SelfCuts(int(counts.sum()) // 2, cut, places[ranked][counts[ranked] > 0])


def _far_apart(points: NDArray[np.float64], count: int) -> list[int]:
    """Return the numbers of up to ``count`` points, each the farthest from those before it."""
    chosen = [0]
    away = np.linalg.norm(points - points[0], axis=1)
    while len(chosen) < count and away.max() > 0.0:
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return chosen

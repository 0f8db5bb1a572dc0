# SPDX-License-Identifier: Apache-2.0
"""Check that the surfaces of cavities are inside of the body's surface."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.self_cuts import find_self_cuts
from gdfe_ros.mesh.shells import inside, shell_numbers

_REMEDY = "allowed: wholly inside of the body's material; remedy: export all surfaces in the same frame and unit"

Surface = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Vertices (n, 3) [m] and triangles (t, 3) of a closed surface."""


def misplaced_cavities(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64], cavities: Sequence[Surface]
) -> dict[int, str]:
    """Return the text of a defect for the number of each cavity that is not inside of the body's material.

    A cavity is inside if no other surface cuts or touches it, and a point of each of its shells is inside.

    Args:
        vertices: positions of the body's surface [m], shape (n, 3).
        triangles: vertex ids of the body's closed surface, shape (t, 3).
        cavities: closed surfaces of the air, in the same frame.
    """
    surfaces = [(vertices, triangles), *cavities]
    starts = np.cumsum([0, *(len(points) for points, _ in surfaces)])
    points = np.concatenate([own for own, _ in surfaces])
    joined = np.concatenate([ids + start for (_, ids), start in zip(surfaces, starts[:-1], strict=True)])
    owner = np.repeat(np.arange(len(surfaces)), [len(ids) for _, ids in surfaces])
    cuts = find_self_cuts(points, joined)
    found = {}
    for number, (own, ids) in enumerate(cavities):
        mine = owner == number + 1
        crossed = mine[cuts.cut]
        crossed[crossed] = ~find_self_cuts(own, ids).cut[cuts.cut[mine]]
        if crossed.any():
            x, y, z = cuts.places[crossed][0]
            text = "the air is partly outside: its surface cuts or touches that of the body or of other air"
            found[number] = f"{text}, e.g. near ({x:.4g}, {y:.4g}, {z:.4g}) m; {_REMEDY}"
            continue
        _, first = np.unique(shell_numbers(len(own), ids), return_index=True)
        corners = own[ids[first, 0]]
        outside = corners[~inside(corners, points, joined[~mine])]
        if len(outside):
            x, y, z = outside[0]
            text = f"the air is outside of the body's material at ({x:.4g}, {y:.4g}, {z:.4g}) m"
            found[number] = f"{text}; {_REMEDY}"
    return found

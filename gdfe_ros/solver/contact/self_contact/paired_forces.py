# SPDX-License-Identifier: Apache-2.0
"""Published forces of self-contact: the forces of all pairs, distributed to the vertices on both sides."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gdfe_ros.compiled import kernel
from gdfe_ros.mesh.triples import cross, unit
from gdfe_ros.solver.contact.self_contact.closest import area_vector, face_at
from gdfe_ros.solver.contact.touch import Touch

Array = NDArray[np.float64]


def touching_points(
    x: Array, pairs: tuple[NDArray, NDArray, Array, Array], presses: Array, shears: Array, slips: NDArray[np.bool_]
) -> Touch:
    """Return the contact forces at all points that touch; the force on a face or edge is distributed to its corners.

    The indices in the result are indices of points, not of vertices.

    Args:
        x: (n + p, 3) [m] positions of the points.
        pairs: vertex (k,) of each pair, its four other vertices (k, 4) with their weights (k, 4), and unit normals (k,
            3), see `OwnPairs`.
        presses: (k,) [N] normal forces on the vertices.
        shears: (k, 3) [N] friction forces on the vertices.
        slips: (k,) whether each pair slips.
    """
    vertices, quads, weights, normals = pairs
    gaps = np.einsum("ki,ki->k", normals, x[vertices] - np.einsum("ka,kai->ki", weights, x[quads]))
    # Each pair has five entries: its vertex, and the four corners of its face with the opposite force. For two edges,
    # these four contain both ends of the first edge: the vertex itself, and the other end with a negative weight.
    own = (quads == vertices[:, None]) | (weights < 0.0)
    nearest = quads[np.arange(len(quads)), np.where(own, -1.0, weights).argmax(axis=1)]
    other = np.column_stack([nearest, np.where(own, nearest[:, None], vertices[:, None])]).ravel()
    share = np.column_stack([np.ones(len(weights)), -weights])
    size = np.abs(share) * presses[:, None]
    touched, place = np.unique(np.column_stack([vertices, quads]), return_inverse=True)
    place, pair = place.ravel(), np.repeat(np.arange(len(quads)), 5)
    spread = sparse.csr_matrix((share.ravel(), (place, pair)), shape=(len(touched), len(quads)))
    push, rub = spread @ (presses[:, None] * normals), spread @ shears
    slip = np.bincount(place, weights=np.where(slips[:, None], size, -size).ravel())
    # The partner and the gap reported for a vertex are those of the pair with the largest force on it.
    largest, order = np.zeros(len(touched), np.int64), np.argsort(size, axis=None, kind="stable")
    largest[place[order]] = order
    length = np.linalg.norm(push, axis=1)
    on = (length > 0.0) | rub.any(axis=1)
    return Touch(
        vertices=touched[on].astype(np.int32),
        others=other[largest[on]].astype(np.int32),
        places=x[touched[on]],
        normals=push[on] / np.where(length > 0.0, length, 1.0)[on, None],
        gaps=gaps[pair[largest[on]]],
        presses=length[on],
        shears=rub[on],
        slips=slip[on] > 0.0,
    )


@kernel
def frames(x, quads):
    """Return the frames (k, 3, 3) of faces (k, 4) at positions (n, 3) [m]; columns are axes, the third the normal."""
    axes = np.empty((len(quads), 3, 3))
    for k in range(len(quads)):
        u, v = face_at(x, quads[k], 0.5, 0.5)[1], area_vector(x, quads[k])
        first, normal = unit(u), unit(v)
        axes[k, :, 0], axes[k, :, 1], axes[k, :, 2] = first, cross(normal, first), normal
    return axes

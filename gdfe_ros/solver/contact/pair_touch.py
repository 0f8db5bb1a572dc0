# SPDX-License-Identifier: Apache-2.0
"""Published forces of self-contact: the forces of vertex-face pairs, distributed to the vertices on both sides."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import kernel
from gdfe_ros.mesh.triples import along, corner, cross, minus
from gdfe_ros.solver.contact.gap import unit
from gdfe_ros.solver.contact.touch import Touch


def touching_points(
    x: NDArray[np.float64],
    origin: NDArray[np.float64],
    vertices: NDArray[np.int32],
    quads: NDArray[np.int32],
    *,
    weights: NDArray[np.float64],
    normals: NDArray[np.float64],
    presses: NDArray[np.float64],
    shears: NDArray[np.float64],
    slips: NDArray[np.bool_],
) -> Touch:
    """Return the contact forces at all points that touch; a face's force is distributed to its corners.

    The indices in the result are those of points, not of vertices.

    Args:
        x: (n + p, 3) [m] positions of the points, relative to ``origin``.
        origin: (3,) [m] world position of the origin of ``x``.
        vertices: (k,) vertex of each pair.
        quads: (k, 4) corners of each pair's face.
        weights: (k, 4) weights of the corners at the point of contact.
        normals: (k, 3) unit normals out of the faces.
        presses: (k,) [N] normal forces on the vertices.
        shears: (k, 3) [N] friction forces on the vertices.
        slips: (k,) whether each pair slips.
    """
    places = np.einsum("ka,kai->ki", weights, x[quads])
    gaps = np.einsum("ki,ki->k", normals, x[vertices] - places)
    # Each pair has five entries: its vertex, and the four corners of its face with the opposite force. For two edges,
    # these four contain both ends of the first edge: the vertex itself, and the other end with a negative weight.
    own = (quads == vertices[:, None]) | (weights < 0.0)
    nearest = quads[np.arange(len(quads)), np.where(own, -1.0, weights).argmax(axis=1)]
    ends = np.column_stack([vertices, quads])
    share = np.column_stack([np.ones(len(weights)), -weights])
    other = np.column_stack([nearest, np.where(own, nearest[:, None], vertices[:, None])])
    pushes = (share * presses[:, None])[:, :, None] * normals[:, None]
    rubs = share[:, :, None] * shears[:, None]
    size = np.abs(share) * presses[:, None]
    return _sum_forces(x, origin, ends, other, size, pushes, rubs, slips, gaps)


def _sum_forces(
    x: NDArray[np.float64],
    origin: NDArray[np.float64],
    ends: NDArray[np.int32],
    other: NDArray[np.int32],
    size: NDArray[np.float64],
    pushes: NDArray[np.float64],
    rubs: NDArray[np.float64],
    slips: NDArray[np.bool_],
    gaps: NDArray[np.float64],
) -> Touch:
    """Return the sums of the forces on the vertices of the pairs' five entries.

    ``ends`` (k, 5) are the entries' vertices, ``other`` (k, 5) what they touch, ``size`` (k, 5) [N] the magnitudes of
    the normal forces ``pushes`` (k, 5, 3) [N], and ``rubs`` (k, 5, 3) [N] the friction forces. ``slips`` (k,) and
    ``gaps`` (k,) [m] are those of the pairs.
    """
    touched, place = np.unique(ends, return_inverse=True)
    place, count = place.reshape(ends.shape), len(touched)
    push, rub, slip = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count)
    np.add.at(push, place, pushes)
    np.add.at(rub, place, rubs)
    np.add.at(slip, place, np.where(slips[:, None], size, -size))
    # The partner and the gap reported for a vertex are those of the pair with the largest force on it.
    order = np.argsort(size, axis=None, kind="stable")
    partner, gap = np.zeros(count, np.int32), np.zeros(count)
    partner[place.ravel()[order]] = other.ravel()[order]
    gap[place.ravel()[order]] = np.repeat(gaps, 5)[order]
    length = np.linalg.norm(push, axis=1)
    on = (length > 0.0) | rub.any(axis=1)
    return Touch(
        vertices=touched[on].astype(np.int32),
        others=partner[on],
        places=x[touched[on]] + origin,
        normals=push[on] / np.where(length > 0.0, length, 1.0)[on, None],
        gaps=gap[on],
        presses=length[on],
        shears=rub[on],
        slips=slip[on] > 0.0,
    )


def tangential(vectors: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the components of vectors (k, 3) in the planes with unit normals (k, 3)."""
    return vectors - np.einsum("ki,ki->k", vectors, normals)[:, None] * normals


@kernel
def frames(x, quads):
    """Return the frames (k, 3, 3) of faces (k, 4) at positions (n, 3) [m]. Columns are axes, the third the normal."""
    axes = np.empty((len(quads), 3, 3))
    for k in range(len(quads)):
        a, b, c, d = corner(x, quads[k, 0]), corner(x, quads[k, 1]), corner(x, quads[k, 2]), corner(x, quads[k, 3])
        u, v, w = along(1.0, minus(b, a), 1.0, minus(c, d)), minus(c, a), minus(d, b)
        first, normal = unit(u[0], u[1], u[2]), cross(v, w)
        normal = unit(normal[0], normal[1], normal[2])
        axes[k, :, 0], axes[k, :, 1], axes[k, :, 2] = first, cross(normal, first), normal
    return axes

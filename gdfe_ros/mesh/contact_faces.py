# SPDX-License-Identifier: Apache-2.0
"""Triangles between the contact points of a skin, with which skins touch each other.

Each point of the skin belongs to the contact point that is nearest along the skin. A triangle of the skin whose corners
belong to three contact points becomes a triangle of these three. This is the image of the skin under a simplicial map:
if the skin is closed, the triangles are a closed surface, too. Points on a crease of the skin belong to contact points
on the crease that are near, so that creases stay sharp.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

from gdfe_ros.mesh.edge_ids import number_edges
from gdfe_ros.mesh.winding import edge_counts

if TYPE_CHECKING:
    from gdfe_ros.mesh.skin_points import SkinPoints

ALONG = 1.0
"""A point on a crease belongs to the nearest contact point on the crease if this is not farther away, as a multiple of
the size of the point's cell.
"""
_NONE = -9999
"""Value of scipy's `dijkstra` for a point that no source reaches."""


def contact_faces(skin: SkinPoints, chosen: NDArray[np.intp]) -> NDArray[np.int32]:
    """Return the triangles (f, 3) int32 between contact points, in the orientation of the skin.

    ``chosen`` (p,) are the points of the skin that are contact points. The triangles have their indices from 0 to p.
    """
    owner = _owners(skin, chosen)
    faces = owner[skin.triangles]
    faces = faces[(faces >= 0).all(axis=1)]
    ordered = np.sort(faces, axis=1)
    thick = (ordered[:, 0] < ordered[:, 1]) & (ordered[:, 1] < ordered[:, 2])
    ordered, faces = ordered[thick], faces[thick]
    after = np.take_along_axis(np.roll(faces, -1, axis=1), faces.argmin(axis=1)[:, None], axis=1)[:, 0]
    unique, which = np.unique(ordered, axis=0, return_inverse=True)
    turns = np.bincount(which.reshape(-1), np.where(after == ordered[:, 1], 1, -1), minlength=len(unique))
    forward, backward = unique[turns > 0.0], unique[turns < 0.0][:, ::-1]
    return np.concatenate([forward, backward]).astype(np.int32)


def _owners(skin: SkinPoints, chosen: NDArray[np.intp]) -> NDArray[np.int64]:
    """Return the index (k,) of the contact point to which each point of a skin belongs; -1 if none can be reached."""
    number = np.full(len(skin.places) + 1, -1)
    number[chosen] = np.arange(len(chosen))
    found, _ = _nearest(skin.places, edge_counts(skin.triangles)[0], chosen)
    sharp = chosen[skin.kinds[chosen] < 2]
    if len(sharp):
        along, away = _nearest(skin.places, number_edges(skin.creases)[0], sharp)
        found = np.where(away <= ALONG * skin.sizes, along, found)
    return number[found]


def _nearest(
    places: NDArray[np.float64], edges: NDArray[np.int64], sources: NDArray[np.intp]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the source (k,) that is nearest to each point along ``edges`` (e, 2), and its distance [m].

    They are -1 and infinite if no source is connected to a point.
    """
    length = np.linalg.norm(places[edges[:, 0]] - places[edges[:, 1]], axis=1)
    length = np.maximum(length, np.finfo(float).tiny)
    graph = sparse.csr_matrix((length, edges.T), shape=(len(places), len(places)))
    away, _, owner = dijkstra(graph, directed=False, indices=sources, min_only=True, return_predecessors=True)
    return np.where(owner == _NONE, -1, owner).astype(np.int64), away

# SPDX-License-Identifier: Apache-2.0
"""Layers of fibres on faces of a mesh, and linear maps from the nodes of a face to the present vector of a fibre."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.cells.tetrahedra import face_slopes, triangle_rule

STEEPEST = 0.05
"""Smallest allowed sine of the angle between a face's normal and the direction that is projected onto the face."""


@dataclass(frozen=True, eq=False)
class FibrePoints:
    """Integration points of fibres on faces.

    The present vector of the fibre at point p of face f is d = sum_b factors[f, p, b] x_b, with |d| = 1 at rest.

    Attributes:
        faces: (f, c) int32 nodes of the faces: 4 corners, or the 6 nodes of quadratic tetrahedra.
        factors: (f, p, c) [1/m].
        areas: (f, p) [m^2] undeformed areas of the points.
    """

    faces: NDArray[np.int32]
    factors: NDArray[np.float64]
    areas: NDArray[np.float64]


def perpendicular_faces(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], along: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Return the indices of the ``faces`` (f, c) to which the direction ``along`` (3,) is almost perpendicular."""
    normals = _frames(vertices, faces)[1]
    across = np.linalg.norm(np.cross(normals, along / np.linalg.norm(along)), axis=2).min(axis=1)
    return np.flatnonzero(across < STEEPEST)


def fibre_points(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], along: NDArray[np.float64], angle: float
) -> FibrePoints:
    """Return the integration points of a layer of fibres.

    Args:
        vertices: undeformed positions (n, 3) [m].
        faces: (f, 4) or (f, 6) nodes of the faces; normals point out of the material.
        along: direction (3,), which is projected onto each face. No face is perpendicular to it.
        angle: angle [rad] from the projected direction to the fibres, counter-clockwise seen from outside.
    """
    slopes, normals, areas = _frames(vertices, faces)
    first = along - np.einsum("fpi,i->fp", normals, along)[..., None] * normals
    first /= np.linalg.norm(first, axis=2, keepdims=True)
    fibre = np.cos(angle) * first + np.sin(angle) * np.cross(normals, first)
    spans = np.einsum("fai,pak->fpik", vertices[faces], slopes)
    local = np.einsum("fpkl,fpil,fpi->fpk", np.linalg.inv(np.einsum("fpik,fpil->fpkl", spans, spans)), spans, fibre)
    return FibrePoints(faces.astype(np.int32), np.einsum("pak,fpk->fpa", slopes, local), areas)


def _frames(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return slopes of shape functions (p, c, 2), unit normals (f, p, 3) and areas (f, p) [m^2] of the points."""
    slopes, weights = _rule(faces.shape[1])
    spans = np.einsum("fai,pak->fpik", vertices[faces], slopes)
    normals = np.cross(spans[..., 0], spans[..., 1])
    sizes = np.linalg.norm(normals, axis=2)
    return slopes, normals / sizes[..., None], weights * sizes


def _rule(corners: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return dN_a/dxi_k (p, c, 2) at the integration points of a face, and their weights (p,)."""
    if corners == 6:
        places, weights = triangle_rule(2)
        return face_slopes(places), 0.5 * weights
    signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    places = signs / np.sqrt(3.0)
    other = 1.0 + places[:, None, ::-1] * signs[None, :, ::-1]
    return 0.25 * signs * other, np.ones(4)


@dataclass(frozen=True, eq=False, kw_only=True)
class FibreLayer:
    """A layer of fibres on faces, without thickness and without resistance to bending.

    The energy of each family of fibres is the integral of k/2 e^2 over the undeformed area, with the Green strain
    e = (lambda^2 - 1) / 2 and the stretch lambda of the fibre.

    Attributes:
        name: name, unique among the actuators, loads and layers of the scene.
        stiffness: k [N/m] of each family: force per width and strain, i.e. Young's modulus times thickness.
        compression: whether the fibres also resist compression; otherwise they are slack for e < 0.
        families: integration points of each family of parallel fibres.
    """

    name: str
    stiffness: float
    compression: bool
    families: tuple[FibrePoints, ...]

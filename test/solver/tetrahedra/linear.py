# SPDX-License-Identifier: Apache-2.0
"""Small displacements of a body of tetrahedra: one linear solve with the tangents of its undeformed elements."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from gdfe_ros.materials import Law, Material
from gdfe_ros.materials.table import BULK, LOCAL, PENALTY
from gdfe_ros.mesh import HexMesh, TetMesh
from gdfe_ros.mesh.assembly import merge_vertices
from gdfe_ros.mesh.cells.faces import HEX_FACES
from gdfe_ros.mesh.cells.tet_operators import gradients
from gdfe_ros.mesh.cells.tetrahedra import face_slopes, face_weights, triangle_rule
from gdfe_ros.mesh.tetmesh import elevate
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.quadratic_tetrahedra import element_tangents


def tangents(body: Body) -> NDArray[np.float64]:
    """Return the initial element stiffnesses (m, 30, 30) [N/m], with the whole bulk modulus instead of pressures."""
    table, count = body.table, len(body.cells)
    parameters = table.parameters.copy()
    carried = parameters[:, PENALTY] > 0.0
    parameters[carried, PENALTY] = parameters[carried, BULK]
    out = np.zeros((count, 30, 30))
    given = body.material, np.zeros(count), np.ones(count), table._replace(parameters=parameters), out
    element_tangents(body.rest, body.shape, body.blocks, *given)
    return out


def displacements(
    mesh: TetMesh, law: Material, force: NDArray[np.float64], held: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return the displacements (n, 3) [m] under forces (n, 3) [N]; components marked in ``held`` (n, 3) are zero."""
    body = Body.build(mesh.vertices, mesh.cells, [law], np.zeros(mesh.n_cells, np.int32), [])
    rows = (3 * mesh.cells[:, :, None] + np.arange(3)).reshape(mesh.n_cells, 30)
    first, second = np.repeat(rows, 30, axis=1).ravel(), np.tile(rows, (1, 30)).ravel()
    matrix = sparse.coo_matrix((tangents(body).ravel(), (first, second))).tocsr()
    free = np.flatnonzero(~held.ravel())
    options = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    found = np.zeros(held.size)
    found[free] = splu(matrix[free][:, free].tocsc(), **options).solve(force.ravel()[free])
    return found.reshape(-1, 3)


def pushed(mesh: TetMesh, faces: NDArray[np.int32], traction: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Return the nodal forces (n, 3) [N] of a pressure [Pa] or a traction (3,) [Pa] on boundary faces (q, 6)."""
    nodes, force = mesh.vertices[faces], np.zeros_like(mesh.vertices)
    for place, weight in zip(*triangle_rule(3), strict=True):
        along = np.einsum("qai,ak->qki", nodes, face_slopes(place))
        normal = 0.5 * weight * np.cross(along[:, 0], along[:, 1])
        size = np.linalg.norm(normal, axis=1, keepdims=True)
        acting = -normal * traction if np.ndim(traction) == 0 else size * traction
        np.add.at(force, faces, face_weights(place)[None, :, None] * acting[:, None])
    return force


def starred(mesh: HexMesh) -> TetMesh:
    """Return a conforming mesh with 24 tetrahedra per hexahedron, and vertices at the centres of cells and faces."""
    corners = mesh.vertices[mesh.cells]
    faces = mesh.cells[:, HEX_FACES]
    count = mesh.n_vertices
    centre = count + np.arange(mesh.n_cells)
    middle = count + mesh.n_cells + np.arange(6 * mesh.n_cells).reshape(-1, 6)
    points = [mesh.vertices, corners.mean(axis=1), mesh.vertices[faces].mean(axis=2).reshape(-1, 3)]
    tets = np.stack(
        [
            faces,
            np.roll(faces, -1, axis=2),
            np.broadcast_to(middle[:, :, None], faces.shape),
            np.broadcast_to(centre[:, None, None], faces.shape),
        ],
        axis=3,
    ).reshape(-1, 4)
    # The centre of a face is there twice, once for each of its cells.
    return merge_vertices(elevate(np.concatenate(points), tets[:, [1, 0, 2, 3]]))


def round_faces(mesh: TetMesh, least: float, most: float) -> NDArray[np.int32]:
    """Return the boundary faces (q, 6) with a radial normal, at distances ``least`` to ``most`` [m] from the origin."""
    faces = mesh.surface()
    a, b, c = np.moveaxis(mesh.vertices[faces[:, :3]], 1, 0)
    normal, centre = np.cross(b - a, c - a), (a + b + c) / 3.0
    distance = np.linalg.norm(centre, axis=1)
    along = np.abs(np.einsum("qi,qi->q", normal, centre)) / (np.linalg.norm(normal, axis=1) * distance)
    return faces[(along > 0.7) & (distance > least) & (distance < most)]


def snapped(mesh: TetMesh, inner: float, outer: float) -> TetMesh:
    """Return the mesh of a hollow ball with the nodes of its curved faces moved onto the spheres."""
    x, between = mesh.vertices.copy(), 0.5 * (inner + outer)
    for radius, faces in ((inner, round_faces(mesh, 0.0, between)), (outer, round_faces(mesh, between, np.inf))):
        ids = np.unique(faces)
        x[ids] *= radius / np.linalg.norm(x[ids], axis=1, keepdims=True)
    return TetMesh(x, mesh.cells)


def stresses(mesh: TetMesh, law: Material, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return small-strain stresses (m, 4, 3, 3) [Pa] at the integration points, with the split volume term."""
    body = Body.build(mesh.vertices, mesh.cells, [law], np.zeros(mesh.n_cells, np.int32), [])
    slope = np.einsum("eai,egaj->egij", u[mesh.cells], gradients(body.shape.inverse))
    strain = 0.5 * (slope + slope.transpose(0, 1, 3, 2))
    local = body.table.parameters[0, LOCAL] + 2.0 / 3.0 * law.shear0 * (law.law is Law.NEO_HOOKEAN)
    trace = np.einsum("egii->eg", strain)
    mean = (trace * body.shape.weight).sum(axis=1, keepdims=True) / body.shape.volume[:, None]
    pressure = local * trace + (law.bulk - local) * mean
    deviator = strain - trace[..., None, None] / 3.0 * np.eye(3)
    return 2.0 * law.shear0 * deviator + pressure[..., None, None] * np.eye(3)

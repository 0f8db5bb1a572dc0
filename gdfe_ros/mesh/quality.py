# SPDX-License-Identifier: Apache-2.0
"""Checks of a mesh, and the shape and volume of its hexahedra."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import gdfe_ros.mesh.tetmesh as tetmesh
from gdfe_ros.errors import MeshError, show_point
from gdfe_ros.mesh.cavities import inside_volume
from gdfe_ros.mesh.cells.faces import vertex_pieces
from gdfe_ros.mesh.cells.filling import CORNERS as REFERENCE_CORNERS
from gdfe_ros.mesh.cells.filling import trilinear_slopes
from gdfe_ros.mesh.mesh import HexMesh, Mesh

#: Vertices closer than this fraction of the mesh size coincide.
COINCIDENT = 1e-7
#: Cells with a smaller scaled Jacobian are flat or inverted at a corner.
FLAT = 1e-6
#: Largest relative difference between the volume of the cells and the volume inside of their boundary.
SAME_VOLUME = 1e-6
#: Largest number of ids that a message lists.
LISTED = 10


@dataclass(frozen=True, eq=False)
class QualityReport:
    """Result of `check_mesh`.

    Attributes:
        scaled_jacobian: least scaled Jacobian over the corners of each cell, shape (m,). It is 1 for a box and for a
            regular tetrahedron, and <= 0 for a flat or inverted cell.
        aspect: ratio of the longest to the shortest edge of each cell, shape (m,).
        volumes: volume of each cell [m^3], shape (m,).
        parts: number of connected pieces; two pieces have no vertex in common.
        defects: one line for each kind of defect, empty for a sound mesh.

    The arrays are empty if the cells refer to vertices that do not exist.
    """

    scaled_jacobian: NDArray[np.float64]
    aspect: NDArray[np.float64]
    volumes: NDArray[np.float64]
    parts: int
    defects: list[str]

    @property
    def min_scaled_jacobian(self) -> float:
        """Least scaled Jacobian of the mesh (nan without cells)."""
        return float(self.scaled_jacobian.min()) if len(self.scaled_jacobian) else float("nan")

    @property
    def max_aspect(self) -> float:
        """Largest aspect ratio of the mesh (nan without cells)."""
        return float(self.aspect.max()) if len(self.aspect) else float("nan")

    @property
    def volume(self) -> float:
        """Volume of the body [m^3]."""
        return float(self.volumes.sum())


def check_mesh(mesh: Mesh) -> QualityReport:
    """Return a report on a mesh that names every defect; a defect raises no error.

    A mesh of several separate pieces is not a defect.

    Args:
        mesh: the mesh.
    """
    defects = _broken_indices(mesh)
    if defects:
        none = np.zeros(0)
        return QualityReport(none, none, none, 0, defects)
    infinite = np.flatnonzero(~np.isfinite(mesh.vertices).all(axis=1))
    defects += _tell("vertices with a coordinate that is not finite", infinite, "repair the file")
    repeated = np.flatnonzero((np.diff(np.sort(mesh.cells, axis=1), axis=1) == 0).any(axis=1))
    defects += _tell("cells that name a vertex twice", repeated, "re-mesh there, such cells are degenerate")
    with np.errstate(invalid="ignore", over="ignore"):
        if isinstance(mesh, HexMesh):
            jacobian, volumes = scaled_jacobians(mesh), cell_volumes(mesh)
        else:
            jacobian, volumes = tetmesh.scaled_jacobians(mesh), tetmesh.cell_volumes(mesh)
        lengths = mesh.edge_lengths
        shortest, longest = lengths.min(axis=1), lengths.max(axis=1)
        aspect = np.divide(longest, shortest, out=np.full_like(longest, np.inf), where=shortest > 0)
    if not defects:
        misshapen = _find_misshapen(mesh, jacobian, volumes)
        defects += misshapen + _find_overlaps(mesh, upright=not misshapen) + _vertex_defects(mesh)
        defects += [] if defects else _other_volume(mesh, volumes)
    parts = int(vertex_pieces(mesh.cells, mesh.n_vertices).max()) + 1
    return QualityReport(jacobian, aspect, volumes, parts, defects)


def require_sound(mesh: Mesh, where: str = "mesh") -> QualityReport:
    """Return the report of `check_mesh`, or raise an error if it lists a defect.

    Args:
        mesh: the mesh.
        where: name of the mesh in the error, e.g. a file name.

    Raises:
        MeshError: the mesh has defects; the error names every defect.
    """
    report = check_mesh(mesh)
    if report.defects:
        raise MeshError(where, report.defects)
    return report


def list_ids(ids: NDArray[np.integer]) -> str:
    """Return a text with the first ids and the number of the remaining ids, e.g. ``1, 2, 3 and 7 more``."""
    more = f" and {len(ids) - LISTED} more" if len(ids) > LISTED else ""
    return ", ".join(map(str, ids[:LISTED])) + more


def _broken_indices(mesh: Mesh) -> list[str]:
    if mesh.n_cells == 0 or mesh.n_vertices == 0:
        return [f"{mesh.n_vertices} vertices and {mesh.n_cells} cells; allowed: at least one cell"]
    wrong = np.flatnonzero(((mesh.cells < 0) | (mesh.cells >= mesh.n_vertices)).any(axis=1))
    return _tell(f"cells that name vertices outside 0 to {mesh.n_vertices - 1}", wrong, "repair the file")


def _find_misshapen(mesh: Mesh, jacobian: NDArray[np.float64], volumes: NDArray[np.float64]) -> list[str]:
    inside_out = (jacobian < -FLAT) & (volumes < 0)
    folded = (jacobian < -FLAT) & ~inside_out
    flat = np.abs(jacobian) <= FLAT
    if inside_out.all():
        swap = "the lower and upper four vertices" if isinstance(mesh, HexMesh) else "two corners"
        return [f"every cell is inside out; remedy: swap {swap} of each cell"]
    lowest = f" (scaled Jacobian down to {jacobian.min():.3g}; allowed: > 0)"
    return (
        _tell("cells that are inside out", np.flatnonzero(inside_out), "order their vertices as VTK does", mesh)
        + _tell("cells that are folded at a corner" + lowest, np.flatnonzero(folded), "re-mesh there", mesh)
        + _tell("cells that are flat (no volume at a corner)", np.flatnonzero(flat), "re-mesh there", mesh)
    )


def _find_overlaps(mesh: Mesh, *, upright: bool) -> list[str]:
    """Return the defects of cells that overlap others; ``upright`` is whether no cell is inverted or flat."""
    _, first = np.unique(np.sort(mesh.cells, axis=1), axis=0, return_index=True)
    if len(first) < mesh.n_cells:
        again = np.setdiff1d(np.arange(mesh.n_cells), first)
        return _tell("cells that repeat another cell", again, "remove them")
    faces = mesh.boundary
    return _tell("cells that share a face with two or more others", faces.crowded, "re-mesh there") + _tell(
        "cells that lie on the same side of the face that they share with another cell, and overlap it",
        faces.folded if upright else (),
        "re-mesh there; meshers that fill a surface make no such cells",
        mesh,
    )


def _other_volume(mesh: Mesh, volumes: NDArray[np.float64]) -> list[str]:
    """Return a list with a defect if the volume inside the boundary differs from that of the cells; empty if not."""
    inside, whole = inside_volume(mesh.vertices, mesh.boundary.quads), float(volumes.sum())
    if abs(inside - whole) <= SAME_VOLUME * whole:
        return []
    text = f"the cells have a volume of {whole:.6g} m^3, but their boundary encloses {inside:.6g} m^3"
    return [f"{text}; remedy: re-mesh it, cells overlap or do not fit"]


def _vertex_defects(mesh: Mesh) -> list[str]:
    unused = np.flatnonzero(np.bincount(mesh.cells.ravel(), minlength=mesh.n_vertices) == 0)
    twins = np.unique(coincident_pairs(mesh.vertices, COINCIDENT * mesh.size))
    return _tell("vertices that no cell uses", unused, "remove them") + _tell(
        f"vertices at the same place as another (within {COINCIDENT:g} of the size)",
        twins,
        "merge them (`mesh: {file: ..., merge: true}`), or the body comes apart there",
    )


def coincident_pairs(points: NDArray[np.float64], tolerance: float) -> NDArray[np.int64]:
    """Return the pairs of points whose distance is at most a tolerance.

    The points are sorted by their coordinate along a direction that is oblique to all axes. Each point is compared with
    its successors as long as their coordinates differ by at most the tolerance.

    Args:
        points: finite positions [m], shape (n, 3).
        tolerance: distance [m].

    Returns:
        Pairs of indices, shape (p, 2), the smaller index first.
    """
    along = points @ np.array([0.5773, 0.6342, 0.5144])
    order = np.argsort(along, kind="stable")
    along = along[order]
    near, pairs, step = np.arange(len(points)), [], 0
    while len(near):
        step += 1
        near = near[near + step < len(points)]
        near = near[along[near + step] - along[near] <= tolerance]
        first, second = order[near], order[near + step]
        close = np.linalg.norm(points[first] - points[second], axis=1) <= tolerance
        pairs.append(np.stack([first[close], second[close]], axis=1))
    return np.sort(np.concatenate(pairs), axis=1) if pairs else np.zeros((0, 2), dtype=np.int64)


def _tell(what: str, ids: NDArray[np.integer], remedy: str, mesh: Mesh | None = None) -> list[str]:
    """Return a list with one defect about the items with these ids; empty without ids.

    If the ids are those of cells of ``mesh``, the text also has the centroid of the first cell.
    """
    if len(ids) == 0:
        return []
    place = "" if mesh is None else f", the first near {show_point(mesh.centroids[ids[0]])}"
    return [f"{len(ids)} {what}: {list_ids(ids)}{place}; remedy: {remedy}"]


#: The three vertices that edges join to each local vertex, right-handed seen from that vertex.
CORNERS = np.array(
    [[1, 3, 4], [2, 0, 5], [3, 1, 6], [0, 2, 7], [7, 5, 0], [4, 6, 1], [5, 7, 2], [6, 4, 3]], dtype=np.int32
)


def scaled_jacobians(mesh: HexMesh) -> NDArray[np.float64]:
    """Return the least scaled Jacobian over the eight corners of each cell, shape (m,).

    At a corner with the edge vectors a, b, c it is a . (b x c) / (|a| |b| |c|), in [-1, 1]. It is 1 for a box, and <= 0
    for a flat or inverted corner (Knupp 2000; the Verdict library's `scaled jacobian` without the value at the centre).
    At a corner with an edge of zero length it is 0.
    """
    corners = mesh.vertices[mesh.cells]
    edges = corners[:, CORNERS] - corners[:, :, None]
    scale = np.sqrt(np.einsum("mcei,mcei->mce", edges, edges)).prod(axis=2)
    volume = _triple(edges[:, :, 0], edges[:, :, 1], edges[:, :, 2])
    return np.divide(volume, scale, out=np.zeros_like(volume), where=scale > 0).min(axis=1)


def cell_volumes(mesh: HexMesh) -> NDArray[np.float64]:
    """Return the exact volume of each trilinear cell [m^3], shape (m,), negative for an inverted cell.

    The Jacobian determinant of the trilinear map is quadratic in each reference coordinate, so 2 x 2 x 2
    Gauss points integrate it exactly.
    """
    corners = mesh.vertices[mesh.cells]
    volume = np.zeros(mesh.n_cells)
    for point in REFERENCE_CORNERS / np.sqrt(3.0):
        jacobian = np.tensordot(corners, trilinear_slopes(point), axes=(1, 0))
        volume += _triple(jacobian[:, :, 0], jacobian[:, :, 1], jacobian[:, :, 2])
    return volume


def _triple(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> NDArray[np.float64]:
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (np.moveaxis(v, -1, 0) for v in (a, b, c))
    return ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)

# SPDX-License-Identifier: Apache-2.0
"""Inspection of a mesh or surface file: its contents, its defects and their remedies."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.cavities import NO_CAVITY, Cavity, find_cavities
from gdfe_ros.mesh.files.importer import examine_mesh
from gdfe_ros.mesh.files.mesh_input import LONGEST, SHORTEST, guess_unit, unit_defects
from gdfe_ros.mesh.mesh import Mesh
from gdfe_ros.mesh.meshing.surface_findings import SurfaceFindings, cheaper_hexahedra, solid_findings, surface_findings
from gdfe_ros.mesh.meshing.tetrahedralise import (
    STEP_SUFFIXES,
    show_spans,
    solid_facts,
    step_bounds,
    step_facts,
    step_overlaps,
    step_surface,
)
from gdfe_ros.mesh.meshing.voxels import SUFFIXES, examine_surface
from gdfe_ros.mesh.meshing.walls import default_size, flat_walls, wall_cells
from gdfe_ros.mesh.quality import QualityReport, check_mesh
from gdfe_ros.mesh.surfaces.shells import shells
from gdfe_ros.mesh.tetmesh import TetMesh

#: Number of cells along the longest side of the voxel mesh that is suggested for a first run.
_FIRST_GRID = 40


@dataclass(frozen=True, eq=False)
class Inspection:
    """The findings on one file.

    Attributes:
        path: the file.
        facts: pairs (name, value) of texts about the contents, for a table.
        defects: defects, each with its remedy; empty for a usable file.
        remarks: advice about a usable file.
        mesh: the mesh; None for a surface, a STEP file or an unreadable file.
        cavities: cavities of the mesh, the largest first.
        surface: findings on a surface or on the solids of a STEP file; None for a mesh.
    """

    path: Path
    facts: list[tuple[str, str]]
    defects: list[str]
    remarks: list[str] = field(default_factory=list)
    mesh: Mesh | None = None
    cavities: tuple[Cavity, ...] = ()
    surface: SurfaceFindings | None = None


def inspect_file(path: str | Path, *, scale: float | None = None, size: float | None = None) -> Inspection:
    """Inspect a file with cells, a surface or CAD solids. Defects are returned, not raised.

    Args:
        path: the file.
        scale: metres for each unit of the file; None assumes metres and checks whether that is plausible.
        size: intended size of the cells [m], which decides whether the walls of a surface or of CAD solids count as
            thin; None for the default of ``gdfe new``.
    """
    path = Path(path)
    try:
        if path.suffix.lower() in SUFFIXES:
            return _surface(path, scale, size)
        if path.suffix.lower() in STEP_SUFFIXES:
            return _solids(path, size)
        mesh, defects = examine_mesh(path, scale=scale)
    except MeshError as error:
        return Inspection(path, [("file", str(path))], error.defects)
    return inspect_mesh(mesh, path=path, defects=defects)


def inspect_mesh(mesh: Mesh, *, path: Path | None = None, defects: list[str] | None = None) -> Inspection:
    """Describe a mesh of hexahedra or tetrahedra.

    Args:
        mesh: the mesh.
        path: its file.
        defects: the mesh's defects if they are known; None to find them with `check_mesh`.
    """
    quality = check_mesh(mesh)
    found = quality.defects if defects is None else defects
    sound = len(quality.volumes) > 0 and np.isfinite(mesh.vertices).all()
    cavities = tuple(find_cavities(mesh)) if sound else ()
    facts = [
        ("kind", _kind(mesh)),
        ("vertices, cells", f"{mesh.n_vertices}, {mesh.n_cells}"),
        *_extent(mesh.vertices),
        *_quality(quality),
        ("cavities", ", ".join(f"{cavity.volume:.4g} m^3" for cavity in cavities) or "none"),
        ("cell sets", _sets(mesh.cell_sets)),
        ("vertex sets", _sets(mesh.vertex_sets)),
    ]
    notes = [*flat_walls(mesh), *_hexahedra(mesh)] if isinstance(mesh, TetMesh) and not found else []
    return Inspection(path or Path(), facts, found, [*mesh.remarks, *notes], mesh, cavities)


def _hexahedra(mesh: TetMesh) -> list[str]:
    """Return a list with a remark if hexahedra would be much cheaper; empty if not."""
    thinnest = float(wall_cells(mesh)[0].thickness.min(initial=math.inf))
    faces = mesh.boundary.quads[:, :3]
    return cheaper_hexahedra(mesh.vertices, faces, tetrahedra=mesh.n_cells, thinnest=thinnest)


def _kind(mesh: Mesh) -> str:
    """Return the kind of a mesh's cells in words."""
    if isinstance(mesh, TetMesh) and mesh.linear:
        return "tetrahedra of first order, raised to second order (linear ones lock)"
    return "tetrahedra of second order" if isinstance(mesh, TetMesh) else mesh.noun


def _surface(path: Path, scale: float | None, size: float | None) -> Inspection:
    vertices, triangles, defects = examine_surface(path, scale=scale)
    facts = [
        ("kind", "surface, to be filled with `mesh: {tets: ...}` or `mesh: {voxels: ...}`"),
        ("vertices, triangles", f"{len(vertices)}, {len(triangles)}"),
        *_extent(vertices),
    ]
    found = surface_findings(vertices, triangles, size=size or default_size(vertices))
    if found.walls is not None:
        nested = shells(vertices, triangles)
        facts += [
            ("volume", f"{nested.volume:.6g} m^3"),
            ("bodies, cavities", f"{len(nested.depths) - nested.n_cavities}, {nested.n_cavities}"),
            ("a first cell size", f"{np.ptp(vertices, axis=0).max() / _FIRST_GRID:.2g} m"),
        ]
    return Inspection(path, facts + found.facts, defects + found.defects, found.remarks, surface=found)


def _solids(path: Path, size: float | None) -> Inspection:
    facts, bounds = step_facts(path), step_bounds(path)
    surface = step_surface(path)
    found = solid_findings(*surface, size=size or default_size(bounds))
    facts += solid_facts(path, *surface)
    defects = step_overlaps(path)
    remarks = [*([] if defects else found.remarks), *_air(facts)]  # advice on volume and shape counts overlaps twice
    if unit_defects(diagonal := float(np.linalg.norm(bounds[1] - bounds[0])), None):
        text = f"the body's diagonal is {diagonal:g} m; usual for a soft robot: {SHORTEST:g} to {LONGEST:g} m"
        defects.append(f"{text}; remedy: export it again, in the unit in which it was drawn")
    return Inspection(path, facts + found.facts, defects + found.defects, remarks, surface=found)


def _air(facts: list[tuple[str, str]]) -> list[str]:
    """Return a list with a remark on chambers if no solid has a cavity; ``facts`` are those of a STEP file."""
    solids = [text for name, text in facts if name.startswith("solid ")]
    if any("no cavity" not in text for text in solids):
        return []
    if len(solids) > 1:
        return ["no solid has a cavity, but solids that touch may enclose air: `gdfe new` counts the chambers"]
    return [NO_CAVITY]


def _extent(vertices: NDArray[np.float64]) -> list[tuple[str, str]]:
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    size = math.hypot(*(high - low))
    unit = guess_unit(size) if np.isfinite(size) and size > 0 else "unknown"
    return [("bounds", show_spans(low, high)), ("unit, a guess from the size", unit)]


def _quality(quality: QualityReport) -> list[tuple[str, str]]:
    if len(quality.volumes) == 0:
        return []
    return [
        ("volume", f"{quality.volume:.6g} m^3"),
        ("least scaled Jacobian", f"{quality.min_scaled_jacobian:.3g}"),
        ("largest aspect ratio", f"{quality.max_aspect:.3g}"),
        ("inverted or flat cells", str(int((quality.scaled_jacobian <= 0).sum()))),
        ("disconnected parts", str(quality.parts)),
    ]


def _sets(sets: Mapping[str, NDArray[np.int32]]) -> str:
    return ", ".join(f"{name} ({len(ids)})" for name, ids in sets.items()) or "none"

# SPDX-License-Identifier: Apache-2.0
"""Tetrahedral meshes of STEP files (gmsh) and triangle surfaces (fTetWild), made in a separate process and cached."""

from __future__ import annotations

import itertools
import sys
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.assembly import keep_cells
from gdfe_ros.mesh.cells.faces import corners_of
from gdfe_ros.mesh.cells.tetrahedra import EDGES
from gdfe_ros.mesh.contact_skin import out_of_material
from gdfe_ros.mesh.files.mesh_input import require_file, run_mesher
from gdfe_ros.mesh.files.mesher_process import MOST_CELLS, too_many
from gdfe_ros.mesh.files.stored_mesh import keep, key_of, mesh_arrays, mesh_of, recall, under
from gdfe_ros.mesh.meshing.voxels import examine_surface
from gdfe_ros.mesh.meshing.walls import Walls, find_solid_walls, find_walls, wall_sizes
from gdfe_ros.mesh.overlap import find_self_cuts
from gdfe_ros.mesh.selection import FACE_SLACK
from gdfe_ros.mesh.surfaces.shells import BoxTree, cone_volumes, doubled_areas, shells
from gdfe_ros.mesh.surfaces.surface_edges import is_closed, winding_defects
from gdfe_ros.mesh.tetmesh import TetMesh, elevate, scaled_jacobians

STEP_SUFFIXES = (".step", ".stp")
FACETS_ALONG = 30.0
"""Number of facets along the longest side of a STEP file's solids."""


def step_bounds(path: str | Path) -> NDArray[np.float64]:
    """Return the lowest and the highest corner (2, 3) [m] of the bounding box of a STEP file's solids."""
    return _facts(path)["bounds"]


def step_volume(path: str | Path) -> float:
    """Return the volume [m^3] of a STEP file's solids."""
    return float(_facts(path)["volume"])


def step_facts(path: str | Path) -> list[tuple[str, str]]:
    """Return pairs (name, value) of texts about a STEP file: kind, solids, surfaces, bounds in metres, volume."""
    raw = _facts(path)
    return [
        ("kind", "STEP, to be filled with `mesh: {tets: {step: ...}}`"),
        ("solids, surfaces", f"{int(raw['solids'])}, {int(raw['surfaces'])}"),
        ("bounds in metres", show_spans(*raw["bounds"])),
        ("volume", f"{float(raw['volume']):.6g} m^3"),
    ]


def step_overlaps(path: str | Path) -> list[str]:
    """Return a text about each overlap of two solids of a STEP file, with its volume and a remedy."""
    return _show_overlaps(_facts(path)["overlaps"])


def _show_overlaps(overlaps: NDArray[np.float64]) -> list[str]:
    """Return a text about each row (first solid, second solid, common volume [m^3]) of ``overlaps`` (k, 3)."""
    remedy = "remedy: cut one out of the other in the CAD program, or unite them if they are one part"
    return [
        f"solids {a:.0f} and {b:.0f} overlap by {volume:.4g} m^3, whose cells belong to both solid_{a:.0f} and "
        f"solid_{b:.0f}; {remedy}"
        for a, b, volume in overlaps
    ]


def solid_facts(
    path: str | Path, vertices: NDArray[np.float64], triangles: NDArray[np.int64], solid: NDArray[np.int64]
) -> list[tuple[str, str]]:
    """Return a pair (name, text) for each solid of a STEP file: its volume, cavities, and bounds in metres.

    Args:
        path: the STEP file.
        vertices: vertices (n, 3) [m] of the facets, as from `step_surface`.
        triangles: facets (t, 3).
        solid: number (t,) of the solid of each facet.
    """
    facts = []
    for k, name in enumerate(_facts(path)["names"]):
        own = triangles[solid == k]
        found, points = shells(vertices, own), vertices[np.unique(own)]
        inner = [volume for volume, depth in zip(found.volumes, found.depths, strict=True) if depth % 2]
        cavities = f"cavities {', '.join(f'{volume:.4g}' for volume in sorted(inner, reverse=True))} m^3"
        spans = show_spans(points.min(axis=0), points.max(axis=0))
        text = f"{found.volume:.4g} m^3, {cavities if inner else 'no cavity'}, {spans}"
        facts.append((f"solid {k + 1} {str(name).rpartition('/')[2]}".rstrip(), text))
    return facts


def show_spans(low: NDArray[np.float64], high: NDArray[np.float64]) -> str:
    """Return the extents of a box between two corners (3,) as text: ``x 0 to 0.1, y ...``."""
    return ", ".join(f"{axis} {a:.4g} to {b:.4g}" for axis, a, b in zip("xyz", low, high, strict=True))


def _facts(path: str | Path) -> dict[str, NDArray]:
    """Return the arrays of `mesher_process.facts` for a STEP file."""
    path, heading = Path(path), f"step {path}"
    require_file(path, heading)
    return _read(path.resolve(), heading, path.stat().st_mtime_ns)


@lru_cache(maxsize=4)
def _read(path: Path, heading: str, changed: int) -> dict[str, NDArray]:
    """Read the facts of a STEP file in a process with gmsh; ``changed`` [ns] is its time of modification."""
    return run_mesher("facts", {"path": str(path)}, heading)


def step_surface(path: str | Path) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Return facets of a STEP file's solids: vertices (n, 3) [m], triangles (t, 3), and the number (t,) of their solid.

    The normals of the triangles point out of their solid. Where two solids touch, each of them has its own triangles.
    """
    edge = float(np.ptp(step_bounds(path), axis=0).max()) / FACETS_ALONG
    heading = f"step {path}"
    raw = run_mesher("facets", {"path": str(Path(path).resolve()), "size": edge}, heading)
    if "triangles" not in raw:
        raise MeshError(heading, ["there is no solid in it; remedy: export the body as a solid, not as surfaces"])
    return raw["vertices"], raw["triangles"], raw["solid"]


ENVELOPE = 1e-3
"""Largest distance between fTetWild's surface and the file's surface, divided by the diagonal of the body."""
NARROW = 0.1
"""Largest distance between fTetWild's surface and the file's surface, divided by the size of the cells. The smaller of
this limit and that of `ENVELOPE` applies.
"""
SQUEEZED = 0.1
"""A cell keeps its corners if their move into a plane would leave less than this fraction of its volume."""
STRAIGHTENED = 0.1
"""The curved edges of a cell with a scaled Jacobian below this are straightened."""


def from_step(path: str | Path, *, size: float, least_size: float | None = None) -> TetMesh:
    """Fill the solids of a STEP file with quadratic tetrahedra; edges on curved surfaces are curved.

    Lengths are converted to metres from the unit that the file states. The mesh has a cell set ``solid_1``, ... for
    each solid and a vertex set for each surface, by its name in the file or as ``surface_1``, ... Where solids overlap,
    cells are in the sets of both, and the mesh's remarks say so.

    Args:
        path: a .step or .stp file.
        size: largest edge of a cell [m]; edges at curved surfaces may be as short as a fifth of the size.
        least_size: smallest target edge of a cell [m]. If given, cells are smaller where walls are thin (`wall_sizes`).

    Raises:
        MeshError: the file cannot be meshed; the error names the reason.
    """
    path, heading = Path(path), f"step {path}"
    require_file(path, heading, suffixes=STEP_SUFFIXES)
    key = key_of(b"step", path.read_bytes(), *_sizes_key(size, least_size))
    if found := _recall_mesh(key):
        return found
    request = {"path": str(path.resolve()), "size": size}
    if least_size is not None:
        walls = find_solid_walls(*step_surface(path), spacing=least_size)
        request |= _refine(walls, step_bounds(path), size, least_size, heading)
    raw = run_mesher("step", request, heading)
    return _keep_mesh(key, replace(_curve(raw), remarks=tuple(_show_overlaps(raw["overlaps"]))))


def from_surface(
    surface: str | Path, *, size: float, scale: float | None = None, least_size: float | None = None
) -> TetMesh:
    """Fill the inside of a triangle surface with quadratic tetrahedra, which have straight edges.

    The surface may be open or intersect itself; a point is inside if the surface winds around it. In a closed surface
    that does not intersect itself, nested shells of any orientation are cavities. The distance between the mesh's
    surface and the file's surface is at most a thousandth of the body's diagonal, and at most a tenth of ``size``, or
    of ``least_size`` if it is given. Flat faces at the ends of the bounding box stay flat (`_flatten`).

    Args:
        surface: an STL, OBJ, PLY or OFF file.
        size: target edge length of the cells [m].
        scale: metres for each unit of the file; None assumes metres and rejects bodies of implausible size.
        least_size: as for `from_step`; it needs a closed surface.

    Raises:
        MeshError: the surface cannot be meshed; the error names every reason.
    """
    heading = f"surface {surface}"
    vertices, triangles, defects = examine_surface(surface, scale=scale, closed=False)
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    if not defects and size > diagonal:
        defects = [f"size = {size:g} m, but the body's diagonal is {diagonal:.3g} m; remedy: a smaller size"]
    closed = is_closed(triangles)
    if closed and not defects:
        defects = [text for text in [too_many(shells(vertices, triangles).volume, size)] if text]
    elif least_size is not None and not defects:
        text = "least_size needs a closed surface, because the walls of an open one have no thickness"
        defects = [f"{text}; remedy: leave it out, or close the holes, see `gdfe inspect`"]
    if defects:
        raise MeshError(heading, defects)
    key = key_of(b"surface", vertices.tobytes(), triangles.tobytes(), *_sizes_key(size, least_size))
    if found := _recall_mesh(key):
        return found
    cuts = find_self_cuts(vertices, triangles)
    for text in [*winding_defects(vertices, triangles), *cuts.defects]:
        print(f"{heading}: {text}", file=sys.stderr)
    if closed:
        triangles = _outward(vertices, triangles, apart=cuts.pairs == 0)
    request = {"vertices": vertices, "triangles": triangles, "size": size}
    request["epsilon"] = min(ENVELOPE, NARROW * (least_size or size) / diagonal)
    if least_size is not None:
        walls = find_walls(vertices, triangles, spacing=least_size)
        bounds = np.array([vertices.min(0), vertices.max(0)])
        request |= _refine(walls, bounds, size, least_size, heading)
    raw = run_mesher("surface", request, heading)
    if len(raw["cells"]) == 0:
        raise MeshError(heading, [_nothing_inside(vertices, triangles, request["epsilon"] * diagonal, closed)])
    mesh = _flatten(raw["vertices"], raw["cells"], vertices, triangles, request["epsilon"] * diagonal)
    return _keep_mesh(key, keep_cells(mesh, np.ones(mesh.n_cells, dtype=bool)))


def _flatten(
    points: NDArray[np.float64],
    cells: NDArray[np.integer],
    vertices: NDArray[np.float64],
    triangles: NDArray[np.int64],
    envelope: float,
) -> TetMesh:
    """Return the quadratic mesh of linear tetrahedra, with ends as flat as those of the surface.

    fTetWild leaves some corners of flat faces up to ``envelope`` [m] off their plane, where the selection ``face``
    would miss them. Such corners are moved into the plane, but not those of a cell that would become flat (`SQUEEZED`).

    Args:
        points: corners (n, 3) [m] of the tetrahedra.
        cells: (m, 4) indices of ``points``.
        vertices: vertices (k, 3) [m] of the surface.
        triangles: triangles (t, 3) of the surface.
        envelope: largest distance [m] between both surfaces.
    """
    from gdfe_ros.mesh.surfaces.triangle_kernels import nearest_distances  # loads numba

    outer = np.unique(corners_of(elevate(points, cells).surface()))
    moved, away, corners = points.copy(), np.empty(len(outer)), vertices[triangles]
    for axis, end in itertools.product(range(3), (np.min, np.max)):
        plane = end(corners[..., axis])
        flat = (np.abs(corners[..., axis] - plane) <= FACE_SLACK * np.ptp(vertices, axis=0).max()).all(axis=1)
        tree = BoxTree.of(vertices, triangles[flat]) if flat.any() else None
        if tree is None or len(tree.order) == 0:
            continue
        nearest_distances(points[outer], tree.corners, tree.boxes, away)
        moved[outer[away <= envelope], axis] = plane
    before = _volumes(points, cells)
    while (squeezed := cells[np.sign(before) * _volumes(moved, cells) < SQUEEZED * np.abs(before)]).size:
        moved[squeezed] = points[squeezed]
    return elevate(moved, cells)


def _volumes(points: NDArray[np.float64], cells: NDArray[np.integer]) -> NDArray[np.float64]:
    """Return six times the volume (m,) [m^3] of linear tetrahedra."""
    corners = points[cells]
    return np.linalg.det(corners[:, 1:] - corners[:, :1])


def _nothing_inside(vertices: NDArray[np.float64], triangles: NDArray[np.int64], envelope: float, closed: bool) -> str:
    """Return the text of the defect that no tetrahedron is inside a surface.

    The text states how far the mesher may move the surface, ``envelope`` [m], and the thickness of the walls. For a
    thin sheet, the thickness is 2 V / A, where V is the volume inside its surface and A the area of the surface.
    """
    if not closed:
        return "no tetrahedron is inside: the surface encloses nothing; remedy: close it, see `gdfe inspect`"
    area = 0.5 * float(doubled_areas(vertices[triangles])[1].sum())
    thickness = 2.0 * shells(vertices, triangles).volume / area
    return (
        f"no tetrahedron is inside: the surface is closed, but its walls are too thin for the size. They are about "
        f"{thickness:.2g} m thick, and the mesher may move the surface by {envelope:.2g} m; remedy: "
        "thicker walls, or a least_size, see `gdfe inspect`"
    )


def _outward(vertices: NDArray[np.float64], triangles: NDArray[np.int64], *, apart: bool) -> NDArray[np.int64]:
    """Return the triangles of a closed surface with normals out of the material.

    Shells that do not cut each other (``apart``) are nested, and each is oriented by itself. If shells cut each other,
    it is not known which is a cavity, and the surface is oriented as a whole.
    """
    if apart:
        return out_of_material(vertices, triangles)
    return triangles if cone_volumes(vertices, triangles).sum() > 0.0 else triangles[:, ::-1]


def _sizes_key(size: float, least_size: float | None) -> list[bytes]:
    """Return the sizes of cells in the form in which they enter the cache key of a mesh."""
    return [repr(size).encode(), *([] if least_size is None else [repr(least_size).encode()])]


def _refine(
    walls: Walls, bounds: NDArray[np.float64], size: float, least_size: float, heading: str
) -> dict[str, NDArray | float]:
    """Return the entries of a mesher's request for small cells at thin walls.

    Raises:
        MeshError: ``least_size`` is larger than ``size``, or gives too many cells.
    """
    if least_size > size:
        text = f"least_size = {least_size:g} m; allowed: up to size = {size:g} m"
        raise MeshError(heading, [f"{text}; remedy: a smaller least_size"])
    field = wall_sizes(walls, size=size, least_size=least_size, bounds=bounds)
    if field.cells > MOST_CELLS:
        text = f"least_size gives about {field.cells:.2g} tetrahedra at thin walls; allowed: up to {MOST_CELLS:g}"
        raise MeshError(heading, [f"{text}; remedy: a larger least_size"])
    return {"start": field.start, "spacing": field.spacing, "sizes": field.sizes, "least_size": least_size}


def _curve(raw: dict[str, NDArray]) -> TetMesh:
    """Return the mesh from a mesher's arrays, with straightened edges in badly shaped cells (`STRAIGHTENED`)."""
    sets = under(raw, "cell:"), under(raw, "vertex:")
    mesh = TetMesh(raw["vertices"], raw["cells"], *sets)
    vertices = mesh.vertices.copy()
    bad = mesh.cells[scaled_jacobians(mesh) < STRAIGHTENED]
    vertices[bad[:, 4:]] = vertices[bad[:, EDGES]].mean(axis=2)
    mesh = TetMesh(vertices, mesh.cells, *sets)
    return keep_cells(mesh, np.ones(mesh.n_cells, dtype=bool))


def _recall_mesh(key: str) -> TetMesh | None:
    """Return the mesh that is stored under a key; None if there is none."""
    found = recall(key)
    return None if found is None else replace(mesh_of(found), remarks=tuple(found["remarks"].tolist()))


def _keep_mesh(key: str, mesh: TetMesh) -> TetMesh:
    """Store a mesh under a key, and return the mesh."""
    keep(key, {**mesh_arrays(mesh), "remarks": np.array(mesh.remarks, dtype=str)})
    return mesh

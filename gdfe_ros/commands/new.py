# SPDX-License-Identifier: Apache-2.0
"""``gdfe new``: write a first scene for a CAD or mesh file."""

from __future__ import annotations

import argparse
from importlib import import_module
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.embedding import embed
from gdfe_ros.commands.options import require_folder, require_number
from gdfe_ros.constraints import Handle
from gdfe_ros.errors import GdfeError, MeshError
from gdfe_ros.materials.presets import LIBRARY, PRESETS
from gdfe_ros.mesh.cavities import NO_CAVITY, find_cavities, find_misplaced_cavities
from gdfe_ros.mesh.files.importer import read_mesh
from gdfe_ros.mesh.files.mesh_input import require_file
from gdfe_ros.mesh.mesh import Mesh
from gdfe_ros.mesh.meshing.tetrahedralise import STEP_SUFFIXES, from_step, from_surface, step_bounds
from gdfe_ros.mesh.meshing.voxels import SUFFIXES, examine_surface, read_surface
from gdfe_ros.mesh.meshing.walls import default_size
from gdfe_ros.mesh.selection import Side, Where, select_vertices
from gdfe_ros.scene.building.builder import find_unheld, name_piece
from gdfe_ros.scene.document import write_document
from gdfe_ros.scene.report import suggest
from gdfe_ros.scene.schemas.mesh_schema import LEAST_SIZE, SCALE, SIZE
from gdfe_ros.untrusted.regular_file import make_name, quote_path

PRESSURE = 5e3
"""Final pressure [Pa] of the program that is written for a scene with chambers."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("scene", type=Path, help="the YAML file to write")
    parser.add_argument(
        "--from", type=Path, required=True, dest="source", metavar="FILE", help=".stl, .obj, .ply, .step, .msh, ..."
    )
    parser.add_argument("--cavity", type=Path, action="append", default=[], help="closed surface of a chamber inside")
    parser.add_argument(
        "--size", type=float, help="largest edge of the tetrahedra [m]; default: 1/15 of the longest side"
    )
    parser.add_argument(
        "--least-size", type=float, help="smallest edge [m]; if given, cells are smaller where walls are thin"
    )
    parser.add_argument("--scale", type=float, help="metres per unit of the files, e.g. 0.001; STEP states its own")
    parser.add_argument(
        "--material", default="dragon_skin_10", help="a preset, e.g. ecoflex_00_30 (default: %(default)s)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Write the scene; return 0.

    Raises:
        GdfeError: an option is wrong, a file cannot be used (all its defects are listed), or the scene already exists.
    """
    _require_options(arguments)
    entry, mesh = _body(arguments)
    scene = _scene(make_name(arguments.scene.stem), arguments.material, entry, mesh)
    arguments.scene.write_text(write_document(scene))
    print(f"{arguments.scene}: {mesh.n_cells} {mesh.noun}, chambers: {len(scene.get('actuators', {}))}")
    written, picture = quote_path(arguments.scene), quote_path(arguments.scene.with_suffix(".png"))
    lacking = []
    for text in mesh.remarks:
        print(f"note: {text}")
    if unheld := _unheld(mesh):
        print(f"note: no handle holds {'; '.join(unheld)}: parts that do not touch are not bonded")
        lacking.append("a handle for each of these pieces")
    if "program" not in scene:
        print(f"note: {NO_CAVITY}")
        lacking.append("actuators or loads, and a program")
    if lacking:
        print(f"next: add {', '.join(lacking)} (docs/scene.md), then gdfe solve {written}")
    else:
        print(f"next: gdfe solve {written} --picture {picture}")
    return 0


def _unheld(mesh: Mesh) -> list[str]:
    """Return texts that name the pieces of a mesh that are not held at the lower end of its longest axis."""
    base = Handle("base", select_vertices(mesh, Where(face=Side(_end(mesh)))), fixed=True)
    return [name_piece(mesh, vertices) for axis, vertices in find_unheld(mesh, [base]) if axis == "x"]


def _end(mesh: Mesh) -> str:
    """Return the face, e.g. `x-`, at the lower end of the body's longest axis."""
    return f"{'xyz'[int(np.argmax(np.ptp(mesh.vertices, axis=0)))]}-"


def _require_options(arguments: argparse.Namespace) -> None:
    """Raise an error if an option is wrong, before any file is read."""
    scene = arguments.scene
    if scene.exists():
        raise MeshError(f"scene {scene}", ["there is such a file already; remedy: another name"])
    require_folder("scene", scene)
    require_number("--size", arguments.size, SIZE)
    require_number("--least-size", arguments.least_size, LEAST_SIZE)
    require_number("--scale", arguments.scale, SCALE)
    name, usable = arguments.material, [name for name in PRESETS if LIBRARY[name].poisson is not None]
    if name not in PRESETS:
        raise GdfeError(f"--material {name}: there is no such preset{suggest(name, usable)}")
    if name not in usable:
        text = "this preset of a filament has no Poisson's ratio, and a scene with it needs the key `poisson`"
        raise GdfeError(f"--material {name}: {text}; remedy: edit the scene later; allowed here: {', '.join(usable)}")


def _body(arguments: argparse.Namespace) -> tuple[dict, Mesh]:
    """Return the scene's entry `mesh`, and the mesh that it describes."""
    source, folder = arguments.source, arguments.scene.resolve().parent
    if arguments.cavity and source.suffix.lower() not in SUFFIXES:
        text = (
            f"--cavity belongs to a body of {', '.join(SUFFIXES)}; remedy: draw the chambers as hollows of the body, "
        )
        raise MeshError(f"file {source}", [f"{text}and close blind holes by a second solid, e.g. a plate"])
    require_file(source, f"file {source}")
    scale = {} if arguments.scale is None else {"scale": arguments.scale}
    if source.suffix.lower() in STEP_SUFFIXES:
        if scale:
            raise MeshError(f"file {source}", ["a STEP file states its unit; remedy: leave out --scale"])
        sizes = _sizes(arguments, step_bounds(source) if arguments.size is None else None)
        return {"tets": {"step": _relative(source, folder), **sizes}}, from_step(source, **sizes)
    if source.suffix.lower() not in SUFFIXES:
        if arguments.least_size is not None:
            text = "--least-size belongs to surfaces and STEP files, but this file has cells already; leave it out"
            raise MeshError(f"mesh {source}", [text])
        return {"file": _relative(source, folder), **scale}, read_mesh(source, scale=arguments.scale)
    if arguments.cavity:
        source = _join(arguments)
        scale = {}
    vertices, _ = read_surface(source, scale=scale.get("scale"), closed=False)
    sizes = _sizes(arguments, vertices)
    entry = {"surface": _relative(source, folder), **sizes, **scale}
    return {"tets": entry}, from_surface(source, **sizes, scale=scale.get("scale"))


def _join(arguments: argparse.Namespace) -> Path:
    """Write the body and its cavities as one surface in metres beside the scene; return its path."""
    trimesh = import_module("trimesh")
    paths, surfaces, defects = [arguments.source, *arguments.cavity], [], []
    for path in paths:
        vertices, triangles, found = examine_surface(path, scale=arguments.scale)
        surfaces.append((vertices, triangles))
        defects += [f"{path}: {text}" for text in found]
    if not defects:
        texts = find_misplaced_cavities(*surfaces[0], surfaces[1:])
        defects = [f"{paths[1 + number]}: {text}" for number, text in texts.items()]
    whole = trimesh.util.concatenate([trimesh.Trimesh(*surface, process=False) for surface in surfaces])
    if defects:
        raise MeshError(f"surface {arguments.source}", defects)
    path = arguments.scene.with_name(f"{arguments.scene.stem}_body.stl")
    whole.export(path)
    return path


def _sizes(arguments: argparse.Namespace, points: NDArray[np.float64] | None) -> dict[str, float]:
    """Return the entries `size` and `least_size` [m]; the default size fits a body with these points (n, 3)."""
    given = {"size": arguments.size, "least_size": arguments.least_size}
    if arguments.size is None:
        given["size"] = default_size(points)
    return {name: value for name, value in given.items() if value is not None}


def _relative(path: Path, folder: Path) -> str:
    """Return a path for the scene file: relative to the scene's ``folder`` if it is inside, else absolute."""
    path = path.resolve()
    return str(path.relative_to(folder)) if path.is_relative_to(folder) else str(path)


def _far_end(mesh: Mesh, axis: int) -> list[float]:
    """Return the middle [m] of the body's upper end along an axis or, if there is no material, the nearest vertex."""
    vertices = mesh.vertices
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    middle = 0.5 * (low + high)
    middle[axis] = high[axis]
    place = np.round(middle, 9) + 0.0  # nanometres: no digits of rounding, and no -0.0 in the file
    try:
        embed(mesh, place, what="tip")
    except MeshError:
        place = vertices[np.linalg.norm(vertices - middle, axis=1).argmin()]
    return [float(value) for value in place]


def _scene(name: str, material: str, mesh_entry: dict, mesh: Mesh) -> dict:
    """Return a scene in which the lower end of the body's longest axis is fixed, with a chamber for each cavity."""
    axis = int(np.argmax(np.ptp(mesh.vertices, axis=0)))
    chambers = {
        f"air_{i}": {"chamber": {"cavity": i, "command": "pressure", "range": [0.0, 4.0 * PRESSURE]}}
        for i in range(len(find_cavities(mesh)))
    }
    scene = {
        "name": name,
        "mesh": mesh_entry,
        "materials": {"body": {"preset": material}},
        "regions": [{"material": "body"}],
        "handles": {"base": {"where": {"face": _end(mesh)}, "fixed": True}},
        "probes": {"tip": _far_end(mesh, axis)},
    }
    if not chambers:
        return scene
    rises = {name: [{"time": 0.0, "value": 0.0}, {"time": 1.0, "value": PRESSURE}] for name in chambers}
    program = {"duration": 1.0, "actuators": rises}
    return {**scene, "actuators": chambers, "program": program}

# SPDX-License-Identifier: Apache-2.0
"""``gdfe inspect``: report the contents and defects of a mesh or surface file, and draw it."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from gdfe_ros.commands.options import require_number, require_picture
from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.files.mesh_input import require_file
from gdfe_ros.mesh.inspection import Inspection, inspect_file
from gdfe_ros.mesh.quality import check_mesh
from gdfe_ros.scene.schemas.mesh_schema import SCALE, SIZE
from gdfe_ros.untrusted.terminal import QUANTITIES, PlainConsole, make_table

DEFECTIVE = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "files",
        nargs="+",
        metavar="FILE",
        type=Path,
        help="one or several files: hexahedra or tetrahedra (.msh, .vtk, .vtu, .inp), a surface (.stl, .obj, .ply), "
        "or .step; several files give one line for each",
    )
    parser.add_argument("--scale", type=float, help="metres per unit of the file, e.g. 0.001 for millimetres")
    parser.add_argument(
        "--size", type=float, help="size of cells [m] with which walls are compared; default: that of `gdfe new`"
    )
    parser.add_argument(
        "--picture",
        type=Path,
        metavar="FILE.png",
        help="draw cells, coloured by their quality, or a surface, coloured by its thickness, with its defects in red",
    )


def run(arguments: argparse.Namespace) -> int:
    """Inspect a file and print the result; return 0, or 1 if it has defects that prevent its use.

    Raises:
        GdfeError: there is no such file, a number is out of range, or the picture cannot be written.
    """
    for path in arguments.files:
        require_file(path, f"file {path}")
        if path.suffix.lower() in (".yaml", ".yml"):
            raise MeshError(f"file {path}", ["it is a scene, not a mesh; remedy: gdfe solve draws and checks scenes"])
    require_number("--size", arguments.size, SIZE)
    require_number("--scale", arguments.scale, SCALE)
    require_picture(arguments.picture)
    if len(arguments.files) > 1:
        if arguments.picture:
            raise MeshError("--picture", ["it draws one file, but several are given; remedy: one file at a time"])
        return _inspect_several(arguments.files, scale=arguments.scale, size=arguments.size)
    found = inspect_file(arguments.files[0], scale=arguments.scale, size=arguments.size)
    rows = [*found.facts, ("verdict", _verdict(found))]
    PlainConsole().print(make_table(str(found.path), QUANTITIES[:2], rows, min_width=64))
    for defect in found.defects:
        PlainConsole(stderr=True).print(f"fix: {defect}", style="red")
    for remark in found.remarks:
        PlainConsole(stderr=True).print(f"note: {remark}", style="yellow")
    if arguments.picture:
        _draw(arguments.picture, found)
    return DEFECTIVE if found.defects else 0


def _inspect_several(paths: Sequence[Path], *, scale: float | None, size: float | None) -> int:
    """Print one line for each file: its kind and size, or its first defect; return 0, or 1 if one has defects."""
    console, worst = PlainConsole(soft_wrap=True, highlight=False), 0
    for path in paths:
        found = inspect_file(path, scale=scale, size=size)
        facts = dict(found.facts)
        known = [
            facts[key] for key in ("kind", "vertices, cells", "vertices, triangles", "solids, surfaces") if key in facts
        ]
        notes = f"; {len(found.remarks)} remarks" if found.remarks else ""
        first = f": {found.defects[0]}" if found.defects else ""
        style = "red" if found.defects else None
        console.print(f"{path}: {'; '.join([*known, _verdict(found)])}{notes}{first}", style=style)
        worst = DEFECTIVE if found.defects else worst
    return worst


def _verdict(found: Inspection) -> str:
    return "can be used as it is" if not found.defects else f"{len(found.defects)} to fix"


def _draw(path: Path, found: Inspection) -> None:
    from gdfe_ros.analysis.picture import draw_body, draw_surface  # matplotlib takes a second to import

    if found.surface is not None:
        draw_surface(path, found.surface, title=f"{found.path.name}: {len(found.surface.triangles)} triangles")
        return
    if found.mesh is None or found.mesh.n_cells == 0:
        raise MeshError(f"file {found.path}", ["there is nothing to draw in it"])
    mesh, quality = found.mesh, check_mesh(found.mesh)
    title = f"{found.path.name}: {mesh.n_cells} cells, {len(found.cavities)} cavities"
    draw_body(path, mesh, mesh.vertices, quality.scaled_jacobian, title=title, label="scaled Jacobian")

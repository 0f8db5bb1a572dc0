# SPDX-License-Identifier: Apache-2.0
"""``gdfe inspect``: report the contents and defects of a mesh or surface file, and draw it."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.console import Console
from rich.table import Table

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.inspection import Inspection, inspect_file
from gdfe_ros.mesh.quality import check_mesh

DEFECTIVE = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "file",
        type=Path,
        help="file of hexahedra or tetrahedra (.msh, .vtk, .vtu, .inp), of a surface (.stl, .obj, .ply), or .step",
    )
    parser.add_argument("--scale", type=float, help="metres per unit of the file, e.g. 0.001 for millimetres")
    parser.add_argument("--picture", type=Path, metavar="FILE.png", help="draw the cells, coloured by their quality")


def run(arguments: argparse.Namespace) -> int:
    """Inspect a file and print the result; return 0, or 1 if it has defects that prevent its use.

    Raises:
        MeshError: there is no such file.
    """
    if not arguments.file.is_file():
        raise MeshError(f"file {arguments.file}", ["there is no such file"])
    found = inspect_file(arguments.file, scale=arguments.scale)
    Console().print(_table(found))
    for defect in found.defects:
        Console(stderr=True).print(f"fix: {defect}", style="red", markup=False)
    if arguments.picture:
        _draw(arguments.picture, found)
    return DEFECTIVE if found.defects else 0


def _table(found: Inspection) -> Table:
    table = Table(title=str(found.path), title_justify="left", min_width=64)
    table.add_column("quantity")
    table.add_column("value")
    for name, value in found.facts:
        table.add_row(name, value)
    verdict = "can be used as it is" if not found.defects else f"{len(found.defects)} to fix"
    table.add_row("verdict", verdict)
    return table


def _draw(path: Path, found: Inspection) -> None:
    from gdfe_ros.analysis.picture import draw_body  # matplotlib takes a second to import

    if found.mesh is None or found.mesh.n_cells == 0:
        raise MeshError(f"file {found.path}", ["only cells can be drawn; mesh the surface or solid in a scene first"])
    mesh, quality = found.mesh, check_mesh(found.mesh)
    title = f"{found.path.name}: {mesh.n_cells} cells, {len(found.cavities)} cavities"
    draw_body(path, mesh, mesh.vertices, quality.scaled_jacobian, title=title, label="scaled Jacobian")

# SPDX-License-Identifier: Apache-2.0
"""Contact in CalculiX (``*CONTACT PAIR``): a cube on a rigid ball, a ball between rigid plates; quadratic elements."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.cases import LogNeoHooke
from benchmarks.grids import HEXAHEDRON20, Grid
from benchmarks.peers.calculix_peer import available
from benchmarks.peers.ccx_deck import (
    MEGAPASCALS,
    MILLIMETRES,
    CcxElement,
    element_cards,
    law_cards,
    material_name,
    node_cards,
    number_rows,
    set_cards,
    used_nodes,
)
from benchmarks.peers.ccx_output import read_total_forces
from benchmarks.peers.disc import quarter_disc
from benchmarks.peers.peer import PeerError

__all__ = ["available", "press_ball", "press_cube"]

_JOB = "contact"
_STIFF = 200.0
"""Penalty pressure divided by Young's modulus, per millimetre of penetration."""
_CAP = np.linspace(-0.35, 1.5, 21)
"""Positions of the grid lines on the upper cap of the ball. Each position is the tangent of an angle at the ball's
centre, which is zero at the top of the ball. The cube presses the quarter with positive tangents; the lines below zero
are a margin.
"""
_QUARTERS, _SECTORS = 4.0, 180.0
"""Factors from the computed part to the whole: a quarter of the cube, and a sector of two degrees that ccx makes of an
axisymmetric ball."""


def press_cube(law: LogNeoHooke, cells: int, moves: Sequence[float]) -> list[float]:
    """Return the forces [N] of a rigid ball of 40 mm on a cube of 0.1 m, which is fixed at its top.

    Args:
        law: material law of the cube.
        cells: number of cells along the cube's edges, even.
        moves: upward displacements of the ball [m], ascending.

    Raises:
        PeerError: ``ccx`` fails, with the end of its log.
    """
    grid, element = Grid(size=(0.05, 0.05, 0.1), cells=(cells // 2, cells // 2, cells), order=2), CcxElement.C3D20R
    used, (x, y, z) = used_nodes(grid, element), grid.points().T
    sets = {"HELD": z > 0.05 - 1e-9, "MIRROR1": x < 1e-9, "MIRROR2": y < -0.025 + 1e-9}
    lines = [*node_cards(grid, used), *element_cards(grid, element, np.arange(grid.n_cells), name="BODY")]
    for name, chosen in sets.items():
        lines += set_cards(name, np.intersect1d(np.flatnonzero(chosen), used))
    lines += _cap_cards(first_node=len(x) + 1, first_cell=grid.n_cells + 1)
    lines += _pair_cards(law, [(cell + 1, 1) for cell in range((cells // 2) ** 2)])
    lines += ["*BOUNDARY", "HELD,1,3", "MIRROR1,1,1", "MIRROR2,2,2", "TOOL,1,2"]
    for move in moves:
        lines += _step_cards(f"TOOL,3,3,{move * MILLIMETRES:.10g}", first=1.0, large=True)
    return [-_QUARTERS * force[2] for force in _forces(lines, f"cube of {cells}^3 cells")]


def press_ball(law: LogNeoHooke, radius: float, cells: int, approaches: Sequence[float], *, large: bool) -> list[float]:
    """Return the forces [N] of two rigid plates that compress a ball; the model is axisymmetric.

    Args:
        law: material law of the ball.
        radius: radius of the ball [m].
        cells: number of cells along an eighth of the circumference.
        approaches: displacements of each plate towards the centre of the ball [m], ascending.
        large: whether deformations are large, with ``law``. Otherwise they are small, with Hooke's law.

    Raises:
        PeerError: ``ccx`` fails, with the end of its log.
    """
    disc, size = quarter_disc(cells), radius * MILLIMETRES
    points, count = size * disc.points, len(disc.points)
    lines = ["*NODE, NSET=ALL", *(f"{node + 1},{x:.12g},{y:.12g},0." for node, (x, y) in enumerate(points))]
    # A hexahedron as the plate: expanded from an axisymmetric face, it would be degenerate where the ball touches it.
    plate = [(x, y, z) for y in (size, 1.2 * size) for x, z in ((-0.2, -0.2), (-0.2, 0.2), (1.0, 0.2), (1.0, -0.2))]
    lines += ["*NODE, NSET=TOOL"]
    lines += [f"{count + 1 + i},{x * size:.10g},{y:.10g},{z * size:.10g}" for i, (x, y, z) in enumerate(plate)]
    lines += ["*ELEMENT, TYPE=CAX8R, ELSET=BODY"]
    lines += [",".join(map(str, [cell + 1, *nodes + 1])) for cell, nodes in enumerate(disc.cells)]
    last = len(disc.cells) + 1
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=TOOL", ",".join(map(str, [last, *range(count + 1, count + 9)]))]
    for axis, name in enumerate(("AXIS", "HELD")):
        lines += set_cards(name, np.flatnonzero(points[:, axis] < 1e-9))
    lines += ["*SURFACE, NAME=MASTER, TYPE=ELEMENT", f"{last},S1"]
    lines += _pair_cards(law, [(cell + 1, side + 1) for cell, side in disc.rim], large=large)
    lines += ["*BOUNDARY", "AXIS,1,1", "HELD,2,2", "TOOL,1,1", "TOOL,3,3"]
    for approach in approaches:
        lines += _step_cards(f"TOOL,2,2,{-approach * MILLIMETRES:.10g}", first=0.5, large=large)
    return [_SECTORS * force[1] for force in _forces(lines, f"ball of {cells} cells")]


def _cap_cards(*, first_node: int, first_cell: int) -> list[str]:
    """Return the cards of the top of a rigid ball of 40 mm under the middle of the cube, at x = 0, y = -25 mm."""
    count, lines, numbers = len(_CAP) - 1, ["*NODE, NSET=TOOL"], {}
    planes = np.interp(np.arange(2 * count + 1) / 2, np.arange(count + 1), _CAP)
    for i, j, k in np.ndindex(2 * count + 1, 2 * count + 1, 3):
        if i % 2 + j % 2 + k % 2 > 1:
            continue  # no node of a serendipity hexahedron
        way = np.array([planes[i], planes[j], 1.0])
        x, y, z = np.array([0.0, -25.0, -90.0]) + (34.0 + 3.0 * k) * way / np.linalg.norm(way)
        numbers[i, j, k] = first_node + len(numbers)
        lines.append(f"{numbers[i, j, k]},{x:.10g},{y:.10g},{z:.10g}")
    lines.append("*ELEMENT, TYPE=C3D20R, ELSET=TOOL")
    corners, cells = np.rint(HEXAHEDRON20 + 1).astype(int), range(first_cell, first_cell + count**2)
    for cell, (i, j) in zip(cells, np.ndindex(count, count), strict=True):
        lines += number_rows([cell, *(numbers[2 * i + a, 2 * j + b, c] for a, b, c in corners)], per_row=16)
    return [*lines, "*SURFACE, NAME=MASTER, TYPE=ELEMENT", *(f"{cell},S2" for cell in cells)]


def _pair_cards(law: LogNeoHooke, faces: Sequence[tuple[int, int]], *, large: bool = True) -> list[str]:
    """Return the cards of the body's surface (element ``faces``), of its contact with MASTER, and of the materials."""
    name, hooke = material_name(law, name="SOFT"), f"{law.young * MEGAPASCALS:.10g},{law.poisson:.10g}"
    return [
        "*SURFACE, NAME=SLAVE, TYPE=ELEMENT",
        *(f"{cell},S{side}" for cell, side in faces),
        "*SURFACE INTERACTION, NAME=HARD",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR",
        f"{_STIFF * law.young * MEGAPASCALS:.10g}",
        "*CONTACT PAIR, INTERACTION=HARD, TYPE=SURFACE TO SURFACE",
        "SLAVE,MASTER",
        *(law_cards(law, name="SOFT") if large else [f"*MATERIAL, NAME={name}", "*ELASTIC", hooke]),
        "*MATERIAL, NAME=RIGID",
        "*ELASTIC",
        "1000.,0.3",
        f"*SOLID SECTION, ELSET=BODY, MATERIAL={name}",
        "*SOLID SECTION, ELSET=TOOL, MATERIAL=RIGID",
    ]


def _step_cards(moved: str, *, first: float, large: bool) -> list[str]:
    """Return the cards of a step that moves the tool by card ``moved``; ``first`` is the first increment, 0 to 1."""
    how = ", NLGEOM" if large else ""
    told = "*NODE PRINT, NSET=HELD, TOTALS=ONLY, FREQUENCY=1000"
    return [f"*STEP, INC=1000{how}", "*STATIC", f"{first:g},1.", "*BOUNDARY", moved, told, "RF", "*END STEP"]


def _forces(lines: Sequence[str], what: str) -> list[tuple[float, float, float]]:
    """Run ``ccx``; return the force [N] on the tool at the end of every step, the total force of the fixed nodes."""
    with tempfile.TemporaryDirectory(prefix="gdfe_ccx_") as folder:
        Path(folder, f"{_JOB}.inp").write_text("\n".join(lines) + "\n")
        done = subprocess.run(["ccx", _JOB], cwd=folder, env=os.environ, capture_output=True, text=True, check=False)
        if done.returncode != 0 or "*ERROR" in done.stdout:
            tail = "\n".join(done.stdout.strip().splitlines()[-6:])
            raise PeerError(f"calculix {what}: ccx ended with status {done.returncode}:\n{tail}")
        return read_total_forces(Path(folder, f"{_JOB}.dat").read_text())

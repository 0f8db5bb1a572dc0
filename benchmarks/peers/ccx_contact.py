# SPDX-License-Identifier: Apache-2.0
"""Contact in CalculiX (``*CONTACT PAIR``): a cube on a rigid ball; quadratic elements."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.cases import LogNeoHooke
from benchmarks.grids import HEXAHEDRON20, Grid
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
from benchmarks.peers.ccx_output import available, read_total_forces, run_ccx

__all__ = ["available", "press_cube"]

_STIFF = 200.0
"""Penalty pressure divided by Young's modulus, per millimetre of penetration."""
_CAP = np.linspace(-0.35, 1.5, 21)
"""Positions of the grid lines on the upper cap of the ball. Each position is the tangent of an angle at the ball's
centre, which is zero at the top of the ball. The cube presses the quarter with positive tangents; the lines below zero
are a margin.
"""


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
        lines += _step_cards(f"TOOL,3,3,{move * MILLIMETRES:.10g}")
    found = run_ccx("\n".join(lines) + "\n", f"cube of {cells}^3 cells")
    return [-4.0 * force[2] for force in read_total_forces(found.dat)]  # the mesh is a quarter of the cube


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


def _pair_cards(law: LogNeoHooke, faces: Sequence[tuple[int, int]]) -> list[str]:
    """Return the cards of the body's surface (element ``faces``), of its contact with MASTER, and of the materials."""
    name = material_name(law, name="SOFT")
    return [
        "*SURFACE, NAME=SLAVE, TYPE=ELEMENT",
        *(f"{cell},S{side}" for cell, side in faces),
        "*SURFACE INTERACTION, NAME=HARD",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR",
        f"{_STIFF * law.young * MEGAPASCALS:.10g}",
        "*CONTACT PAIR, INTERACTION=HARD, TYPE=SURFACE TO SURFACE",
        "SLAVE,MASTER",
        *law_cards(law, name="SOFT"),
        "*MATERIAL, NAME=RIGID",
        "*ELASTIC",
        "1000.,0.3",
        f"*SOLID SECTION, ELSET=BODY, MATERIAL={name}",
        "*SOLID SECTION, ELSET=TOOL, MATERIAL=RIGID",
    ]


def _step_cards(moved: str) -> list[str]:
    """Return the cards of a step that moves the tool by card ``moved``."""
    told = "*NODE PRINT, NSET=HELD, TOTALS=ONLY, FREQUENCY=1000"
    return ["*STEP, INC=1000, NLGEOM", "*STATIC", "1,1.", "*BOUNDARY", moved, told, "RF", "*END STEP"]

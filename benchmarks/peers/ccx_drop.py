# SPDX-License-Identifier: Apache-2.0
"""CalculiX on the scene `drop`: implicit dynamics (``*DYNAMIC``) with a constant time step, shorter only on failure."""

from __future__ import annotations

import numpy as np

from benchmarks.grids import Grid
from benchmarks.peers.ccx_deck import (
    MILLIMETRES,
    PATIENT,
    CcxElement,
    element_cards,
    law_cards,
    material_name,
    node_cards,
    set_cards,
    used_nodes,
)
from benchmarks.peers.ccx_output import available, read_blocks, run_ccx, to_lattice
from benchmarks.peers.drop_case import DENSITY, GRAVITY, LASTS, LAW, SIZE, TIP, DropPath

__all__ = ["available", "simulate"]

_TONNES = 1e-12
"""Value of 1 kg/m^3 in t/mm^3. The tonne is the unit of mass that is consistent with N, mm and s."""
_LEAST = 1e-5
"""Shortest time step [s] into which CalculiX may divide a step that does not converge."""


def simulate(kind: str, cells: tuple[int, int, int], h: float, *, timeout: float) -> DropPath:
    """Return the path of the tip for the time step ``h`` [s]; its processor time is that of the whole program.

    Raises:
        PeerError: ``ccx`` fails, or takes longer than ``timeout`` [s].
    """
    element = CcxElement(kind)
    grid = Grid(size=SIZE, cells=cells, order=element.order)
    where = f"drop {element.value} {grid.label}, h = {h:g} s"
    found = run_ccx(_deck(grid, element, h), where, timeout=timeout)
    times, paths = read_blocks(found.dat, "displacements")
    return DropPath(times, np.array([_tip(grid, element, nodal) for nodal in paths]), found.processor)


def _deck(grid: Grid, element: CcxElement, h: float) -> str:
    used = used_nodes(grid, element)
    name = material_name(LAW, name="RUBBER")
    lines = [
        *node_cards(grid, used),
        *element_cards(grid, element, np.arange(grid.n_cells), name="BODY"),
        *set_cards("BASE", np.intersect1d(grid.face(right=False), used)),
        *set_cards("TIP", np.intersect1d(grid.face(right=True), used)),
        *law_cards(LAW, name="RUBBER"),
        "*DENSITY",
        f"{DENSITY * _TONNES:.10g}",
        f"*SOLID SECTION, ELSET=BODY, MATERIAL={name}",
        "*BOUNDARY",
        "BASE,1,3",
        f"*STEP, NLGEOM, INC={10 * round(LASTS / h)}, AMPLITUDE=STEP",
        *PATIENT,
        "*DYNAMIC",
        f"{h:g},{LASTS:g},{_LEAST:g},{h:g}",
        "*DLOAD",
        f"BODY,GRAV,{GRAVITY * MILLIMETRES:g},0.,0.,-1.",
        "*NODE PRINT, NSET=TIP, FREQUENCY=1",
        "U",
        "*END STEP",
    ]
    return "\n".join(lines) + "\n"


def _tip(grid: Grid, element: CcxElement, nodal: dict) -> np.ndarray:
    moved = to_lattice(nodal, size=len(grid.points())) / MILLIMETRES
    if element is CcxElement.C3D20R:
        moved = grid.complete_serendipity(moved)
    return np.add(TIP, grid.evaluate(moved, np.array([TIP]))[0])

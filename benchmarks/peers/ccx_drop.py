# SPDX-License-Identifier: Apache-2.0
"""CalculiX on the scene `drop`: implicit dynamics (``*DYNAMIC``) with a constant time step, shorter only on failure."""

from __future__ import annotations

import os
import resource
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.grids import Grid
from benchmarks.peers.calculix_peer import available
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
from benchmarks.peers.ccx_output import read_paths, to_lattice
from benchmarks.peers.drop_case import DENSITY, GRAVITY, LASTS, LAW, SIZE, TIP, DropPath
from benchmarks.peers.peer import PeerError

__all__ = ["available", "simulate"]

_JOB = "drop"
_TONNES = 1e-12
"""Value of 1 kg/m^3 in t/mm^3. The tonne is the unit of mass that is consistent with N, mm and s."""
_LEAST = 1e-5
"""Shortest time step [s] into which CalculiX may divide a step that does not converge."""


def simulate(element: CcxElement, cells: tuple[int, int, int], h: float, *, timeout: float) -> DropPath:
    """Return the path of the tip for the time step ``h`` [s]; its processor time is that of the whole program.

    Raises:
        PeerError: ``ccx`` fails, or takes longer than ``timeout`` [s].
    """
    grid = Grid(size=SIZE, cells=cells, order=element.order)
    where = f"calculix drop {element.value} {grid.label}, h = {h:g} s"
    with tempfile.TemporaryDirectory(prefix="gdfe_ccx_") as folder:
        Path(folder, f"{_JOB}.inp").write_text(_deck(grid, element, h))
        before = _children_time()
        try:
            done = subprocess.run(
                ["ccx", _JOB], cwd=folder, env=os.environ, capture_output=True, text=True, check=False, timeout=timeout
            )
        except subprocess.TimeoutExpired:
            raise PeerError(f"{where}: not done within {timeout:g} s") from None
        seconds = _children_time() - before
        if done.returncode != 0 or "*ERROR" in done.stdout:
            tail = "\n".join(done.stdout.strip().splitlines()[-6:])
            raise PeerError(f"{where}: ccx ended with status {done.returncode}:\n{tail}")
        times, paths = read_paths(Path(folder, f"{_JOB}.dat").read_text())
    return DropPath(times, np.array([_tip(grid, element, nodal) for nodal in paths]), seconds)


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


def _children_time() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime

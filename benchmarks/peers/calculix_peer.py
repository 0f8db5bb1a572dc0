# SPDX-License-Identifier: Apache-2.0
"""CalculiX (``ccx``, GPL-2, a separate program) as a peer.

Its solve time is the wall time of the program, because the program reads the deck, factors and
writes without reporting its phases. This includes the start of the process, a few milliseconds.
"""

from __future__ import annotations

import re
import subprocess
from time import perf_counter

from benchmarks.cases import Case, LogNeoHooke
from benchmarks.grids import Grid
from benchmarks.peers.ccx_deck import MILLIMETRES, CcxElement, Incrementation, write_deck
from benchmarks.peers.ccx_output import (
    CcxRun,
    available,
    count_iterations,
    read_blocks,
    read_displacements,
    run_ccx,
    to_lattice,
)
from benchmarks.peers.peer import Array, PeerSolution, Variant, handle_reaction

__all__ = ["available", "solve"]


def solve(case: Case, variant: Variant, points: Array) -> PeerSolution:
    """Write a deck, run ``ccx`` and read its output; see `Peer.solve`.

    Raises:
        PeerError: if ``ccx`` fails, with the end of its log.
    """
    element = CcxElement(variant.element)
    first, patient = float(variant.options["increment"]), bool(variant.options.get("patient", False))
    incrementation = Incrementation(first=first, patient=patient)
    start = perf_counter()
    grid = case.grid(variant.cells, order=element.order)
    deck = write_deck(case, grid, element, steps=variant.steps, incrementation=incrementation)
    built = perf_counter()
    found = run_ccx(deck, f"{case.name.value} {variant.label}")
    displacement, reaction = _read(found, case, grid, element)
    return PeerSolution(
        displacement=grid.evaluate(displacement, points),
        reaction=reaction,
        time_setup=built - start,
        time_solve=found.wall,
        settings={
            "version": _version(),
            "law": "Ciarlet" if isinstance(case.laws[0], LogNeoHooke) else "Ogden N=3",
            "linear_solver": "SPOOLES",
            "first_increment": incrementation.first,
            "patient": incrementation.patient,
            "iterations": count_iterations(found.log),
        },
    )


def _read(found: CcxRun, case: Case, grid: Grid, element: CcxElement) -> tuple[Array, Array]:
    """Return the displacements of the lattice nodes (n, 3) [m] and the reaction (6,): force [N], moment [N m]."""
    rest = grid.points()
    displacement = to_lattice(read_displacements(found.frd), size=len(rest)) / MILLIMETRES
    if element is CcxElement.C3D20R:
        displacement = grid.complete_serendipity(displacement)
    forces = to_lattice(read_blocks(found.dat, "forces")[1][-1], size=len(rest))
    return displacement, handle_reaction(grid, displacement, forces)


def _version() -> str:
    text = subprocess.run(["ccx", "-v"], capture_output=True, text=True, check=False).stdout
    found = re.search(r"Version (\S+)", text)
    return found.group(1) if found else "unknown"

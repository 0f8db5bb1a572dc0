# SPDX-License-Identifier: Apache-2.0
"""CalculiX (``ccx``, GPL-2, a separate program) as a peer.

Its solve time is the wall time of the program, because the program reads the deck, factors and
writes without reporting its phases. This includes the start of the process, a few milliseconds.
"""

from __future__ import annotations

import re
import subprocess
from time import perf_counter

from benchmarks.cases import Case, CaseName, LogNeoHooke
from benchmarks.grids import Grid
from benchmarks.peers.ccx_deck import MILLIMETRES, CcxElement, Incrementation, write_deck
from benchmarks.peers.ccx_output import (
    CcxRun,
    available,
    count_iterations,
    read_displacements,
    read_reactions,
    run_ccx,
    to_lattice,
)
from benchmarks.peers.peer import Array, PeerSolution, Variant, handle_reaction

__all__ = ["available", "solve", "variants"]

_COARSE = {
    CaseName.BEND5: ((10, 1, 1), (15, 1, 1), (25, 2, 2)),
    CaseName.TWIST90: ((8, 2, 2), (12, 3, 3)),
    CaseName.TENSILE: ((8, 2, 2), (12, 3, 3)),
    CaseName.TWIST90_UNIFORM: ((8, 2, 2), (12, 3, 3)),
}
_QUADRATIC = {CaseName.BEND5: (20, 2, 2)}
# First increment of the load and whether to iterate patiently, the best found on each scene.
_INCREMENT = {
    CaseName.BEND5: (0.25, True),
    CaseName.TWIST90: (0.1, True),
    CaseName.TENSILE: (0.1, True),
    CaseName.TWIST90_UNIFORM: (0.1, True),
}
_INCREMENT_QUADRATIC = {
    CaseName.BEND5: (0.25, True),
    CaseName.TWIST90: (1.0, False),
    CaseName.TENSILE: (0.25, True),
    CaseName.TWIST90_UNIFORM: (1.0, False),
}


def variants(case: Case) -> tuple[Variant, ...]:
    """Return the elements on the paper's mesh and on coarser meshes, with tuned load increments."""
    linear, quadratic = _INCREMENT[case.name], _INCREMENT_QUADRATIC[case.name]
    steps = 2 if case.name is CaseName.TWIST90 else 1
    runs = [_variant(CcxElement.C3D8I, cells, *linear) for cells in _COARSE[case.name]]
    runs.append(_variant(CcxElement.C3D20R, _QUADRATIC.get(case.name, (8, 2, 2)), *quadratic))
    runs.append(_variant(CcxElement.C3D8, case.cells, *linear))
    runs.append(_variant(CcxElement.C3D8I, case.cells, *linear, steps=steps))
    runs.append(_variant(CcxElement.C3D20R, case.cells, *quadratic))
    return tuple(runs)


def _variant(
    element: CcxElement,
    cells: tuple[int, int, int],
    increment: float,
    patient: bool,
    *,
    steps: int = 1,
) -> Variant:
    return Variant(
        label=f"{element.value} {'x'.join(map(str, cells))}",
        element=element.value,
        cells=cells,
        steps=steps,
        options={"increment": increment, "patient": patient},
    )


def solve(case: Case, variant: Variant, points: Array) -> PeerSolution:
    """Write a deck, run ``ccx`` and read its output; see `Peer.solve`.

    Raises:
        PeerError: if ``ccx`` fails, with the end of its log.
    """
    element = CcxElement(variant.element)
    incrementation = Incrementation(
        first=float(variant.options.get("increment", 1.0)), patient=bool(variant.options.get("patient", False))
    )
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
    forces = to_lattice(read_reactions(found.dat), size=len(rest))
    return displacement, handle_reaction(grid, displacement, forces)


def _version() -> str:
    text = subprocess.run(["ccx", "-v"], capture_output=True, text=True, check=False).stdout
    found = re.search(r"Version (\S+)", text)
    return found.group(1) if found else "unknown"

# SPDX-License-Identifier: Apache-2.0
"""Input decks of CalculiX (``ccx``) for the benchmark bars.

The units are mm, N and MPa, because CalculiX prints few digits, and its convergence checks work best
with numbers that are neither very large nor very small.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt

from benchmarks.cases import Case, Law, LogNeoHooke, OgdenSeries
from benchmarks.grids import HEXAHEDRON8, HEXAHEDRON20, Grid

MILLIMETRES = 1e3
"""Millimetres in a metre."""
MEGAPASCALS = 1e-6
"""Megapascals in a pascal."""
PATIENT = ["*CONTROLS, PARAMETERS=TIME INCREMENTATION", "30,60,9,60,30,4,,60,,"]
"""Cards of a step that allow up to 60 iterations if residuals decrease slowly."""
_STIFF = 1e15
"""Compliances D2 and D3 of the Ogden law at which their terms have no effect; zero would mean a default."""


class CcxElement(Enum):
    """Hexahedra of CalculiX."""

    C3D8 = "C3D8"
    """Linear, fully integrated: locks in bending and near incompressibility."""
    C3D8I = "C3D8I"
    """Linear with incompatible modes: no locking in bending."""
    C3D20R = "C3D20R"
    """Quadratic serendipity, reduced integration."""

    @property
    def order(self) -> int:
        """Order of the node lattice."""
        return 2 if self is CcxElement.C3D20R else 1

    @property
    def nodes(self) -> npt.NDArray[np.float64]:
        """Reference coordinates of the nodes in CalculiX order."""
        return HEXAHEDRON20 if self is CcxElement.C3D20R else HEXAHEDRON8


@dataclass(frozen=True, kw_only=True)
class Incrementation:
    """Division of a step into increments by CalculiX.

    Attributes:
        first: first increment as a fraction of the step, 0 to 1.
        patient: whether up to 60 iterations are allowed, if residuals decrease slowly, before an
            increment is halved. With rubber, the defaults halve increments early and need more time.
    """

    first: float = 1.0
    patient: bool = False


def used_nodes(grid: Grid, element: CcxElement) -> npt.NDArray[np.int32]:
    """Return the sorted lattice indices that the elements use, shape (u,), int32.

    The node with lattice index ``index`` has the number ``index + 1`` in the deck.
    """
    return np.unique(grid.connectivity(element.nodes)).astype(np.int32)


def write_deck(case: Case, grid: Grid, element: CcxElement, *, steps: int, incrementation: Incrementation) -> str:
    """Return the text of the input deck.

    Args:
        case: scene.
        grid: mesh of the scene, with the order of the element.
        element: element type.
        steps: number of load steps. Within a step each node moves on a straight line, so that a
            rotating handle needs more than one step.
        incrementation: division of a step into increments.

    Returns:
        The deck. At the end of the last step, CalculiX writes the displacements of all nodes into the
        ``.frd`` file, and the reaction forces of the right face (node set TIP) into the ``.dat`` file.
    """
    used = used_nodes(grid, element)
    right = np.intersect1d(grid.face(right=True), used)
    lines = [*_mesh_cards(case, grid, element, used), *set_cards("BASE", np.intersect1d(grid.face(right=False), used))]
    lines += set_cards("TIP", right)
    for index, law in enumerate(case.laws):
        lines += law_cards(law, name=f"LAW{index}")
        material = material_name(law, name=f"LAW{index}")
        lines.append(f"*SOLID SECTION, ELSET=SEGMENT{index}, MATERIAL={material}")
    if case.slides:
        for node in right[1:]:
            lines += ["*EQUATION", "2", f"{node + 1},1,1.,{right[0] + 1},1,-1."]
    lines += ["*BOUNDARY", "BASE,1,3"]
    points = grid.points()[right]
    for step in range(1, steps + 1):
        target = case.handle_displacement(points, load=step / steps) * MILLIMETRES
        lines += _step_cards(right, target, incrementation, free_x=case.slides, last=step == steps)
    return "\n".join(lines) + "\n"


def material_name(law: Law, *, name: str) -> str:
    """Return the name of the material. CalculiX selects its Ciarlet law by the first letters of the name."""
    return f"CIARLET_EL_{name}" if isinstance(law, LogNeoHooke) else name


def law_cards(law: Law, *, name: str) -> list[str]:
    """Return the cards of a material.

    CalculiX has no neo-Hookean law in logarithmic form. Its Ciarlet law differs only in the
    volumetric term: ``lame/2 ((J^2 - 1)/2 - ln J)`` instead of ``lame/2 (ln J)^2``. Both are equal
    to second order. On bend5 with nu 0.45, the displacements differ by 0.002 % (computed with FElupe).
    """
    if isinstance(law, LogNeoHooke):
        constants = f"{law.young * MEGAPASCALS:.10g},{law.poisson:.10g}"
        return [f"*MATERIAL, NAME={material_name(law, name=name)}", "*USER MATERIAL, CONSTANTS=2", constants]
    return [f"*MATERIAL, NAME={material_name(law, name=name)}", *_ogden_cards(law)]


def _ogden_cards(law: OgdenSeries) -> list[str]:
    terms = [f"{m * MEGAPASCALS:.10g},{a:.10g}" for m, a in zip(law.mu, law.alpha, strict=True)]
    compliance = [2.0 / (law.bulk * MEGAPASCALS)] + [_STIFF] * (len(law.mu) - 1)
    values = ",".join([*terms, *(f"{value:.10g}" for value in compliance)]).split(",")
    rows = [",".join(values[start : start + 8]) for start in range(0, len(values), 8)]
    return [f"*HYPERELASTIC, OGDEN, N={len(law.mu)}", *rows]


def _mesh_cards(case: Case, grid: Grid, element: CcxElement, used: npt.NDArray[np.int32]) -> list[str]:
    lines, law = node_cards(grid, used), case.cell_law(grid)
    for index in range(len(case.laws)):
        lines += element_cards(grid, element, np.nonzero(law == index)[0], name=f"SEGMENT{index}")
    return lines


def node_cards(grid: Grid, used: npt.NDArray[np.int32]) -> list[str]:
    """Return the cards of the nodes with lattice indices ``used`` (u,), as the set ALL."""
    points = grid.points()[used] * MILLIMETRES
    lines = [f"{node + 1},{x:.10g},{y:.10g},{z:.10g}" for node, (x, y, z) in zip(used, points, strict=True)]
    return ["*NODE, NSET=ALL", *lines]


def element_cards(grid: Grid, element: CcxElement, cells: npt.NDArray[np.int64], *, name: str) -> list[str]:
    """Return the cards of the elements ``cells`` (c,), as the set ``name``."""
    connectivity = grid.connectivity(element.nodes) + 1
    lines = [f"*ELEMENT, TYPE={element.value}, ELSET={name}"]
    for cell in cells:
        lines += number_rows([cell + 1, *connectivity[cell]], per_row=16)
    return lines


def number_rows(numbers: Iterable[int], *, per_row: int) -> list[str]:
    """Return lines with ``per_row`` integers each; all lines except the last end with a comma."""
    text = [str(int(number)) for number in numbers]
    rows = [",".join(text[start : start + per_row]) for start in range(0, len(text), per_row)]
    return [row + "," for row in rows[:-1]] + rows[-1:]


def set_cards(name: str, nodes: npt.NDArray[np.int32]) -> list[str]:
    """Return the cards of a set of nodes with lattice indices ``nodes`` (k,)."""
    rows = number_rows(nodes + 1, per_row=12)
    return [f"*NSET, NSET={name}", *(row.rstrip(",") for row in rows)]


def _step_cards(
    nodes: npt.NDArray[np.int32],
    target: npt.NDArray[np.float64],
    incrementation: Incrementation,
    *,
    free_x: bool,
    last: bool,
) -> list[str]:
    patience = PATIENT if incrementation.patient else []
    lines = ["*STEP, NLGEOM, INC=1000", *patience, "*STATIC", f"{incrementation.first:g},1.", "*BOUNDARY"]
    for axis in (1, 2) if free_x else (0, 1, 2):
        lines += [
            f"{node + 1},{axis + 1},{axis + 1},{value:.10g}" for node, value in zip(nodes, target[:, axis], strict=True)
        ]
    if last:
        lines += ["*NODE FILE, NSET=ALL, FREQUENCY=1000", "U", "*NODE PRINT, NSET=TIP, FREQUENCY=1000", "RF"]
    return [*lines, "*END STEP"]

# SPDX-License-Identifier: Apache-2.0
"""Errors of coarse meshes in this solver, FElupe and CalculiX, on equal cells: ``python -m benchmarks.coarse_meshes``.

The exact solutions are those of Saint-Venant, of Euler and Bernoulli, of Lame, and of FElupe's triquadratic hexahedra.
The extra ``bench`` installs FElupe, ``apt-get install calculix-ccx`` installs CalculiX. A solver that is not installed
is left out.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from benchmarks.cases import CaseName
from benchmarks.coarse_meshes import calculix_linear, felupe_linear, own
from benchmarks.coarse_meshes.large import CELLS, all_bars, bar_errors
from benchmarks.coarse_meshes.problem import Found, Problem
from benchmarks.coarse_meshes.problems import CONFINED, PAD, PROBLEMS, WIDTH
from benchmarks.coarse_meshes.table import all_tables
from benchmarks.peers import calculix_peer, felupe_peer
from benchmarks.report import options, write_report
from gdfe_ros.solver.settings import Torsion

ACROSS = (1, 2, 4, 8)
FINENESS = (2, 4, 8)
"""Numbers of cells over half of the pad's height, for which the pad's reference is computed."""


def solvers() -> tuple[dict[str, Callable[[Problem], Found]], dict[str, str]]:
    """Return dict from name in the table to available solver, and dict from missing solver to the reason."""
    found: dict[str, Callable[[Problem], Found]] = {
        "gdfe_ros": own.solve,
        "gdfe_ros, torsion: section": partial(own.solve, torsion=Torsion.SECTION),
    }
    reasons = {"FElupe": felupe_peer.available(), "CalculiX": calculix_peer.available()}
    if reasons["FElupe"] is None:
        found["FElupe Q1P0"] = felupe_linear.solve
    if reasons["CalculiX"] is None:
        found |= {f"CalculiX {name}": partial(calculix_linear.solve, element=name) for name in ("C3D8I", "C3D8R")}
    return found, {name: reason for name, reason in reasons.items() if reason is not None}


def main() -> None:
    """Run the measurement, write the report and print the tables; or print how the reference of the pad converges."""
    parser = options("benchmarks.coarse_meshes", "What a few cells across cost.", "coarse_meshes")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(PROBLEMS)}; all if left out")
    parser.add_argument("--reference", action="store_true", help="print the pad's reference on finer cells instead")
    arguments = parser.parse_args()
    if arguments.reference:
        found = [felupe_linear.pad_modulus(cells, WIDTH, CONFINED) for cells in FINENESS]
        for cells, modulus in zip(FINENESS, found, strict=True):
            print(f"{cells} cells over half of the height: {modulus:.4f}")
        first, second, third = found
        print(f"limit: {third - (third - second) ** 2 / (third - 2.0 * second + first):.4f}, taken: {PAD}")
        return
    found, missing = solvers()
    for name, reason in missing.items():
        print(f"missing: {name}: {reason}")
    errors = {
        name: {who: [error(name, across, solve) for across in ACROSS] for who, solve in found.items()}
        for name in arguments.names or PROBLEMS
    }
    report = {"across": ACROSS, "missing": missing, "errors": errors, "bars": all_bars()}
    write_report(arguments.out, report, probe())
    print("\n\n".join(all_tables(report).values()))


def probe() -> dict[str, float]:
    """Return the errors of every problem and of each of the benchmark's bars, with two cells across."""
    found = {f"{name}: error": error(name, ACROSS[1], own.solve) for name in PROBLEMS}
    for name in CaseName:
        errors = bar_errors(name, CELLS[name][0], Torsion.CELL)
        found |= {f"{name.value}: {what}": value for what, value in errors.items()}
    return found


def error(name: str, across: int, solve: Callable[[Problem], Found]) -> float:
    """Return the relative error of a solver on the problem ``name`` with ``across`` cells across."""
    problem = PROBLEMS[name](across)
    return problem.measure(solve(problem)) - 1.0


if __name__ == "__main__":
    main()

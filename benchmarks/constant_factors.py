# SPDX-License-Identifier: Apache-2.0
"""Factors of constant matrices: ours compared with libraries, in turn: ``python -m benchmarks.constant_factors``.

Times are processor times of one thread. The libraries are scipy's SuperLU and, if cholespy is installed (the extra
`bench`), CHOLMOD.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from statistics import median
from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from benchmarks.factors import seconds
from benchmarks.markdown import markdown_table
from benchmarks.report import options, write_report
from benchmarks.scaling import SIZES
from gdfe_ros.mesh import bar
from gdfe_ros.mesh.operators import shape_operators
from gdfe_ros.solver.matrix.constant_matrix import assemble
from gdfe_ros.solver.matrix.factor import Factor, Factorisation
from gdfe_ros.solver.matrix.inverse import apply_free

REPEATS = 9
LARGEST = {"SuperLU": 40_000, "CHOLMOD": 200_000}
"""Dict from library to the largest number of vertices for which it is measured."""
HEADINGS = ("vertices", "numbers in the factor [10^6]", "precision", "factorisation [s]", "solve [ms]")
Solve = Callable[[], object]


def rows() -> list[dict[str, Any]]:
    """Return the measurements of every size of the benchmark's bars, which are fixed at one end."""
    return [measured(cells) for cells in SIZES]


def probe() -> dict[str, float]:
    """Return the number of entries in the factors of the two smallest bars."""
    found = {}
    for cells in SIZES[:2]:
        factor = Factor(*held_bar(cells), Factorisation.SUPERNODES)
        found[f"{cells[0]} cells long: numbers"] = int(factor.inverse.value_start[-1])
    return found


def measured(cells: tuple[int, int, int]) -> dict[str, Any]:
    """Return the number of vertices, the entries of our own factor, and the times [s] of each kind of factor."""
    matrix, points = held_bar(cells)
    right = np.random.default_rng(0).standard_normal((len(points), 3))
    out, flat = np.empty_like(right), right.reshape(-1)
    began = time.process_time()
    factor = Factor(matrix, points, Factorisation.SUPERNODES)
    taken = {"supernodes": time.process_time() - began}
    solves: dict[str, Solve] = {"supernodes": lambda: apply_free(factor.inverse, flat, out.reshape(-1), None)}
    for name, prepare in {"SuperLU": _superlu, "CHOLMOD": _cholmod}.items():
        if len(points) <= LARGEST[name]:
            began = time.process_time()
            solve = prepare(matrix, right, out)
            if solve is not None:
                taken[name], solves[name] = time.process_time() - began, solve
    times = [{name: seconds(solve) for name, solve in solves.items()} for _ in range(REPEATS)]
    return {
        "vertices": len(points),
        "entries": int(factor.inverse.value_start[-1]),
        "coarse": len(factor.inverse.coarse) > 0,
        "factor": taken,
        "solve": {name: median(each[name] for each in times) for name in solves},
    }


def held_bar(cells: Sequence[int]) -> tuple[sparse.csc_matrix, NDArray[np.float64]]:
    """Return the constant matrix of a bar's free vertices, and their positions (f, 3) [m]."""
    mesh = bar([0.1 * count for count in cells], cells)
    shape = shape_operators(mesh.vertices, mesh.cells)
    free = np.flatnonzero(mesh.vertices[:, 0] > 1e-9)
    assembled = assemble(shape, np.ones(mesh.n_cells), np.full(mesh.n_cells, 0.02))
    return assembled[free][:, free].tocsc(), mesh.vertices[free]


def table(report: Sequence[Mapping[str, Any]]) -> str:
    """Return the comparison as a Markdown table."""
    names = [name for name in ("SuperLU", "CHOLMOD") if any(name in row["solve"] for row in report)]
    heads = [*HEADINGS, *(f"{name}: {what}" for name in names for what in ("factorisation [s]", "solve [ms]"))]
    found = []
    for row in report:
        cells = [str(row["vertices"]), f"{row['entries'] / 1e6:.2f}", "16 bits" if row["coarse"] else "double"]
        for name in ("supernodes", *names):
            known = name in row["solve"]
            cells += [f"{row['factor'][name]:.3g}", f"{1e3 * row['solve'][name]:.3g}"] if known else ["-", "-"]
        found.append(cells)
    return markdown_table(heads, found)


def _superlu(matrix: sparse.csc_matrix, right: NDArray[np.float64], out: NDArray[np.float64]) -> Solve:
    factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})

    def solve() -> None:
        out[...] = factor.solve(right)

    return solve


def _cholmod(matrix: sparse.csc_matrix, right: NDArray[np.float64], out: NDArray[np.float64]) -> Solve | None:
    try:
        import cholespy
    except ImportError:
        return None
    entries = matrix.tocoo()
    indices = entries.row.astype(np.int32), entries.col.astype(np.int32)
    factor = cholespy.CholeskySolverD(matrix.shape[0], *indices, entries.data, cholespy.MatrixType.COO)
    return lambda: factor.solve(right, out)


def main() -> None:
    """Run the measurement, write the report and print the table."""
    words = "Factors of constant matrices, ours and those of libraries."
    given = options("benchmarks.constant_factors", words, "constant_factors").parse_args()
    held = held_bar(SIZES[0])
    Factor(*held, Factorisation.SUPERNODES)  # compiled
    found = rows()
    write_report(given.out, found, probe())
    print(table(found))


if __name__ == "__main__":
    main()

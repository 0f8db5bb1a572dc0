# SPDX-License-Identifier: Apache-2.0
"""Prints the sag of a clamped bar of tetrahedra, and the time of an element: ``python -m benchmarks.tets``.

With ``--peers``, the table includes the sags of Drake and Newton, if they are installed (`pip install drake newton`):
linear tetrahedra, final states of motions.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from benchmarks.markdown import markdown_table
from benchmarks.tets.bar import sag
from benchmarks.tets.peers import peer_sags
from gdfe_ros.materials import NeoHookean
from gdfe_ros.mesh import Mesh, bar
from gdfe_ros.mesh.tetmesh import divided
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.barrier import NONE
from gdfe_ros.solver.elements.response import evaluate

CELLS = ([5, 1, 1], [10, 2, 2], [20, 4, 4])
CONVERGED = {0.45: 18.0, 0.4999: 17.8}
REPEATS = 60


def sags(*, peers: bool) -> str:
    """Return the table of sags [mm], errors and times [ms] for meshes of both cell types."""
    rows = []
    for cells in CELLS:
        grid = bar([0.1, 0.02, 0.02], cells)
        for noun, mesh in (("tetrahedra", divided(grid)), ("hexahedra", grid)):
            row = ["x".join(map(str, cells)) + (" x 6" if noun == "tetrahedra" else ""), noun, mesh.n_vertices]
            for poisson, exact in CONVERGED.items():
                law = NeoHookean(young=2e5, poisson=poisson)
                sag(mesh, law)  # compiles
                found = sag(mesh, law)
                row += [f"{1e3 * found.metres:.2f}", f"{1e5 * found.metres / exact - 100.0:+.1f}"]
                row += [found.iterations, f"{1e3 * (found.setup + found.solve):.0f}"]
            rows.append([str(value) for value in row])
        if peers:
            rows += [["x".join(map(str, cells)) + " x 6", *row] for row in peer_sags(grid, CONVERGED)]
    names = [
        f"{name}, nu = {nu:g}" for nu in CONVERGED for name in ("sag [mm]", "error [%]", "iterations", "time [ms]")
    ]
    return markdown_table(["cells", "kind", "nodes", *names], rows)


def element_time(mesh: Mesh) -> float:
    """Return the least time [ns] of an element's forces in one thread, with the neo-Hookean law."""
    count = mesh.n_cells
    law = NeoHookean(young=2e5, poisson=0.45)
    body = Body.build(mesh.vertices, mesh.cells, [law], np.zeros(count, np.int32), [])
    out = np.zeros((*mesh.cells.shape, 3)), np.zeros(count)
    given = 1.1 * mesh.vertices, body.shape, body.blocks, body.material, np.zeros(count), np.ones(count), body.table
    evaluate(*given, NONE, *out, None)
    times = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        evaluate(*given, NONE, *out, None)
        times.append(time.perf_counter() - began)
    return 1e9 * min(times) / count


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--peers", action="store_true", help="run Drake and Newton beside, if installed")
    arguments = parser.parse_args()
    print(sags(peers=arguments.peers))
    for cells, grid in (([13, 13, 12], [7, 7, 7]), ([24, 23, 22], [13, 13, 12])):
        whole, parts = bar([0.1, 0.1, 0.1], cells), divided(bar([0.1, 0.1, 0.1], grid))
        hexahedron, tetrahedron = element_time(whole), element_time(parts)
        print(
            f"time of an element: {hexahedron:.0f} ns of {whole.n_cells} hexahedra, {tetrahedron:.0f} ns of "
            f"{parts.n_cells} tetrahedra, ratio {tetrahedron / hexahedron:.2f}"
        )


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""Solution of a `Problem` with CalculiX: one linear static step with CalculiX' hexahedra."""

from __future__ import annotations

import os
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.coarse_meshes.problem import YOUNG, Found, Problem
from benchmarks.peers.ccx_deck import MEGAPASCALS, MILLIMETRES, number_rows, set_cards
from benchmarks.peers.ccx_output import read_displacements, read_reactions, to_lattice
from benchmarks.peers.peer import PeerError

_JOB = "coarse"


def solve(problem: Problem, element: str) -> Found:
    """Return CalculiX' solution of a problem with the element type ``element``, such as ``C3D8I``.

    Raises:
        PeerError: if ``ccx`` fails, with the end of its log.
    """
    with tempfile.TemporaryDirectory(prefix="gdfe_ccx_") as folder:
        Path(folder, f"{_JOB}.inp").write_text(deck(problem, element))
        done = subprocess.run(["ccx", _JOB], cwd=folder, env=os.environ, capture_output=True, text=True, check=False)
        if done.returncode != 0 or "*ERROR" in done.stdout:
            tail = "\n".join(done.stdout.strip().splitlines()[-6:])
            raise PeerError(f"calculix {element}: ccx ended with status {done.returncode}:\n{tail}")
        moved = read_displacements(Path(folder, f"{_JOB}.frd").read_text())
        forces = read_reactions(Path(folder, f"{_JOB}.dat").read_text())
    count = problem.mesh.n_vertices
    # mm and N; a moment of forces in N about places in m is one in N m.
    return problem.found(to_lattice(moved, size=count) / MILLIMETRES, to_lattice(forces, size=count))


def deck(problem: Problem, element: str) -> str:
    """Return the text of the input deck, in millimetres, newtons and megapascals."""
    points = problem.mesh.vertices * MILLIMETRES
    given, moved = problem.prescribed()
    held = np.unique(np.concatenate([item.vertices for item in problem.held.values()]))
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{node + 1},{x:.10g},{y:.10g},{z:.10g}" for node, (x, y, z) in enumerate(points)]
    lines.append(f"*ELEMENT, TYPE={element}, ELSET=BODY")
    for cell, corners in enumerate(problem.mesh.cells + 1):
        lines += number_rows([cell + 1, *corners], per_row=16)
    lines += set_cards("HELD", held)
    lines += ["*MATERIAL, NAME=SOFT", "*ELASTIC", f"{YOUNG * MEGAPASCALS:.10g},{problem.poisson:.10g}"]
    lines += ["*SOLID SECTION, ELSET=BODY, MATERIAL=SOFT", "*STEP", "*STATIC", "*BOUNDARY"]
    for degree, value in zip(given, moved * MILLIMETRES, strict=True):
        lines.append(f"{degree // 3 + 1},{degree % 3 + 1},{degree % 3 + 1},{value:.10g}")
    if problem.forces is not None:
        lines.append("*CLOAD")
        for node, axis in np.argwhere(problem.forces != 0.0):
            lines.append(f"{node + 1},{axis + 1},{problem.forces[node, axis]:.10g}")
    lines += ["*NODE FILE, NSET=ALL", "U", "*NODE PRINT, NSET=HELD", "RF", "*END STEP"]
    return "\n".join(lines) + "\n"

# SPDX-License-Identifier: Apache-2.0
"""The final checks of the soft beams of Newton (github.com/newton-physics/newton), by their rules."""

from __future__ import annotations

import numpy as np

from benchmarks.public_cases import Row, simulate, solve
from gdfe_ros import Simulation

FOLDER = "newton/examples/vbd"
GRAVITY, DENSITY, YOUNG = 9.81, 1000.0, 1.25e5
THEORY = DENSITY * GRAVITY / (2.0 * YOUNG)
"""Extension M g L / (2 A E) of the hanging beam of 1 m by linear elasticity [m]."""
REFINED = ((10, 2, 2), (20, 4, 4), (40, 8, 8))
"""Cells along and across the hanging beam."""


def newton_rows() -> list[Row]:
    """Return a row for each check."""
    extensions = [extension(simulate("hanging_beam", mesh__bar__cells=list(cells)), 1.0) for cells in REFINED]
    return [_hanging(extensions[1]), _refined(extensions), _stretched(), _twisted(), _released(), _flat()]


def extension(simulation: Simulation, length: float) -> float:
    """Return the mean displacement [m] along x of the end at ``length`` [m] under the weight."""
    rest = simulation.mesh.vertices
    moved = solve(simulation).positions - rest
    return float(moved[np.isclose(rest[:, 0], length), 0].mean())


def volume_ratio(simulation: Simulation) -> float:
    """Return the present volume divided by the undeformed one; all cells of these meshes have the same volume."""
    return float(simulation.fields().J.mean())


def _hanging(found: float) -> Row:
    return Row(
        source="Newton, soft_beam_extension",
        path=f"{FOLDER}/example_soft_beam_extension.py",
        body="a beam hangs, 20 x 4 x 4 cells",
        rule=f"extension within 10 % of M g L / (2 A E) = {THEORY:.5f} m",
        figure=f"{found:.5f} m ({100.0 * (found / THEORY - 1.0):+.1f} %)",
        value=abs(found / THEORY - 1.0),
        bound=0.10,
    )


def _refined(found: list[float]) -> Row:
    coarse, fine = np.diff(found)
    return Row(
        source="Newton, soft_convergence_refinement",
        path=f"{FOLDER}/example_soft_convergence_refinement.py",
        body="the same beam, cells of 100, 50 and 25 mm",
        rule="the second refinement changes the extension less than the first",
        figure=f"{', '.join(f'{each:.5f}' for each in found)} m (ratio {abs(fine / coarse):.2f})",
        value=abs(fine / coarse),
        bound=1.0,
    )


def _stretched() -> Row:
    return _kept_volume("stretch", "is pulled to twice its length", volume_ratio(solve(simulate("stretched_beam"))))


def _twisted() -> Row:
    return _kept_volume("twist", "is twisted by 180 degrees", volume_ratio(solve(simulate("twisted_beam"), 8)))


def _kept_volume(test: str, motion: str, ratio: float) -> Row:
    return Row(
        source=f"Newton, soft_beam_{test}",
        path=f"{FOLDER}/example_soft_beam_{test}.py",
        body=f"a beam with held ends {motion}",
        rule="volume within 10 % of the undeformed one",
        figure=f"{100.0 * (ratio - 1.0):+.1f} %",
        value=abs(ratio - 1.0),
        bound=0.10,
    )


def _released() -> Row:
    pressed = solve(simulate("compressed_cube"), 9)
    released = simulate("compressed_cube", handles__top=None, program=None)
    released.set_positions(pressed.positions)
    height = float(np.ptp(solve(released).positions[:, 0])) / 0.3
    return Row(
        source="Newton, soft_cube_compression",
        path=f"{FOLDER}/example_soft_cube_compression.py",
        body="a cube is pressed to 10 % of its height and released",
        rule="more than 50 % of height and of volume return",
        figure=f"{100.0 * height:.3f} % of the height, {100.0 * volume_ratio(released):.3f} % of the volume",
        value=0.5 / min(height, volume_ratio(released)),
        bound=1.0,
    )


def _flat() -> Row:
    block = simulate("flat_cells")
    flat = extension(block, 0.2)
    cubes = extension(simulate("flat_cells", mesh__bar__cells=[10, 20, 20]), 0.2)
    return Row(
        source="Newton, soft_sliver_elements",
        path=f"{FOLDER}/example_soft_sliver_elements.py",
        body="a block of cells ten times as wide as high hangs",
        rule="positions are finite, within 2 m",
        figure=f"extension {1e3 * flat:.3f} mm; with cubic cells {1e3 * cubes:.3f} mm",
        value=float(np.abs(block.positions).max()),
        bound=2.0,
    )

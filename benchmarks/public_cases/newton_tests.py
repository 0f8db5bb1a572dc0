# SPDX-License-Identifier: Apache-2.0
"""The final checks of the soft beams of Newton (github.com/newton-physics/newton), by their rules."""

from __future__ import annotations

import numpy as np

from benchmarks.public_cases import Row, rows_of, simulate, solve
from gdfe_ros import Simulation

GRAVITY, DENSITY, YOUNG = 9.81, 1000.0, 1.25e5
THEORY = DENSITY * GRAVITY / (2.0 * YOUNG)
"""Extension M g L / (2 A E) of the hanging beam of 1 m by linear elasticity [m]."""
REFINED = ((10, 2, 2), (20, 4, 4), (40, 8, 8))
"""Cells along and across the hanging beam."""


def newton_rows() -> list[Row]:
    """Return a row for each check."""
    extensions = [extension(simulate("hanging_beam", mesh__bar__cells=list(cells)), 1.0) for cells in REFINED]
    excess = extensions[1] / THEORY - 1.0
    ratio = float(abs(np.divide(*np.diff(extensions)[::-1])))
    stretched, twisted = solve(simulate("stretched_beam")), solve(simulate("twisted_beam"), 8)
    volumes = {"stretched": volume_ratio(stretched) - 1.0, "twisted": volume_ratio(twisted) - 1.0}
    height, volume = release()
    flat, block = simulate("flat_cells"), simulate("flat_cells", mesh__bar__cells=[10, 20, 20])
    sags = [1e3 * extension(each, 0.2) for each in (flat, block)]
    return rows_of(
        {
            "hanging": (abs(excess), f"{extensions[1]:.5f} m ({100.0 * excess:+.1f} %)"),
            "refined": (ratio, f"{', '.join(f'{each:.5f}' for each in extensions)} m (ratio {ratio:.2f})"),
            **{name: (abs(change), f"{100.0 * change:+.1f} %") for name, change in volumes.items()},
            "released": (
                0.5 / min(height, volume),
                f"{100.0 * height:.3f} % of the height, {100.0 * volume:.3f} % of the volume",
            ),
            "flat": (
                float(np.abs(flat.positions).max()),
                f"extension {sags[0]:.3f} mm; with cubic cells {sags[1]:.3f} mm",
            ),
        }
    )


def extension(simulation: Simulation, length: float) -> float:
    """Return the mean displacement [m] along x of the end at ``length`` [m] under the weight."""
    rest = simulation.mesh.vertices
    moved = solve(simulation).positions - rest
    return float(moved[np.isclose(rest[:, 0], length), 0].mean())


def volume_ratio(simulation: Simulation) -> float:
    """Return the present volume divided by the undeformed one; all cells of these meshes have the same volume."""
    return float(simulation.fields().J.mean())


def release() -> tuple[float, float]:
    """Return height and volume of a cube that was pressed and released, divided by the undeformed ones."""
    pressed = solve(simulate("compressed_cube"), 9)
    released = simulate("compressed_cube", handles__top=None, program=None)
    released.set_positions(pressed.positions)
    height = float(np.ptp(solve(released).positions[:, 0])) / 0.3
    return height, volume_ratio(released)

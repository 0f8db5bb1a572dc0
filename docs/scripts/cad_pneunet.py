# SPDX-License-Identifier: Apache-2.0
"""A PneuNet finger with a sheet of paper: ``python -m docs.scripts.cad_pneunet`` draws, meshes and inflates it.

The script writes the mesh of the scene `pneunet_finger`, prints by which angle the finger curls, with the sheet and
without, and draws the picture of docs/tutorial.md.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from docs.scripts.cad_finger import Finger
from docs.scripts.drawing import IMAGES, SCENES, draw_scene, write_mesh
from gdfe_ros import Command, Simulation, load_scene

NAME, SIZE = "pneunet_finger", 0.006
FINGER = Finger(base=2.0, channel=3.0)
"""A finger with a thin base, under which a sheet of paper is glued."""
PRESSURES = (5e3, 10e3, 15e3, 20e3)
MODELS: dict[str, dict[str, Any]] = {"paper": {}, "no paper": {"fibres": None}}
"""Dict from model to the overrides of the scene."""


def curls(overrides: dict[str, Any]) -> NDArray[np.float64]:
    """Return the angle [deg] of the tip at each of `PRESSURES`, and how much longer the base has become [mm], (k, 2).

    Raises:
        RuntimeError: a step does not converge.
    """
    simulation, found = Simulation(load_scene(NAME, overrides=overrides)), []
    line = _base_line(simulation)
    for pressure in PRESSURES:
        result = simulation.step(Command(actuators={"air": pressure}))
        if not result.converged:
            raise RuntimeError(result.message)
        places = simulation.probe_positions()
        across = places["tip_top"] - places["tip"]
        spans = np.linalg.norm(np.diff(result.positions[line], axis=0), axis=1)
        found.append([np.degrees(np.arctan2(across[0], across[2])), 1e3 * spans.sum() - FINGER.length])
    return np.array(found)


def _base_line(simulation: Simulation) -> NDArray[np.int64]:
    """Return the vertices on one lower edge of the finger, from its base to its tip."""
    rest = simulation.mesh.vertices
    edge = np.flatnonzero((rest[:, 2] < 1e-6) & (rest[:, 1] < rest[:, 1].min() + 1e-6))
    return edge[np.argsort(rest[edge, 0])]


def compared() -> Table:
    """Return the table of angles and lengths."""
    table = Table(title="curl of the tip in degrees, change of the length of the base in mm")
    table.add_column("kPa", justify="right")
    for name in MODELS:
        table.add_column(name, justify="right")
    rows = zip(PRESSURES, *(curls(given) for given in MODELS.values()), strict=True)
    for pressure, *found in rows:
        table.add_row(f"{1e-3 * pressure:.0f}", *(f"{angle:.1f}, {longer:.2f}" for angle, longer in found))
    return table


def main() -> None:
    """Draw the finger, write its mesh and its picture, and print the table."""
    write_mesh(FINGER, SCENES / f"{NAME}.vtu", size=SIZE)
    draw_scene(NAME, IMAGES / f"{NAME}.png")
    Console(width=110).print(compared())


if __name__ == "__main__":
    main()

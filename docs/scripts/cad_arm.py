# SPDX-License-Identifier: Apache-2.0
"""The measured arm from a parametric drawing: ``python -m docs.scripts.cad_arm`` draws, meshes and inflates it.

The script writes the mesh of the scene `measured_arm`, prints the tip's displacement beside the recorded one, with
hoops and without, and draws the picture of docs/tutorial.md. Dimensions and material are the published ones; nothing
is fitted to the recordings.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.measured_robots.arm_body import MBAR, recorded, tips
from docs.scripts.drawing import IMAGES, SCENES, draw_scene, write_mesh
from gdfe_ros import load_scene

NAME, SIZE = "measured_arm", 0.006
STEP, MOST = 25.0 * MBAR, 400.0 * MBAR
LIMIT = 400
"""Largest number of iterations of a step; a step that needs more counts as without an equilibrium."""
MODELS: dict[str, dict[str, Any]] = {"hoops": {}, "no hoops": {"fibres": None}}
"""Dict from model to the overrides of the scene."""


@dataclass(frozen=True)
class Arm:
    """Dimensions [mm] of the arm of Dubied et al. (2022), which hangs from z = 0 down to z = -length.

    Attributes:
        radius, wall: outer radius, and thickness of the round wall.
        length, solid: length of the arm, and of its solid part at the free end.
        core: a square core with corners on the axes, |x| + |y| <= core.
        partition: thickness of the walls along the axes that separate the four chambers; not published.
        flange: thickness of the plate above z = 0 that closes the chambers and is clamped.
    """

    radius: float = 22.22
    wall: float = 2.03
    length: float = 102.0
    solid: float = 6.93
    core: float = 10.11
    partition: float = 2.0
    flange: float = 3.0

    def draw(self, occ: Any) -> None:
        """Draw the arm with four blind holes, and the flange as a second solid."""
        deep, inner = self.length - self.solid, self.radius - self.wall
        body = (3, occ.addCylinder(0, 0, -self.length, 0, 0, self.length, self.radius))
        long, half = 4.0 * self.radius, 0.5 * self.partition
        walls = [
            (3, occ.addBox(-half, -0.5 * long, -deep, self.partition, long, deep)),
            (3, occ.addBox(-0.5 * long, -half, -deep, long, self.partition, deep)),
        ]
        side = np.sqrt(2.0) * self.core
        core = (3, occ.addBox(-0.5 * side, -0.5 * side, -deep, side, side, deep))
        occ.rotate([core], 0, 0, 0, 0, 0, 1, 0.25 * np.pi)
        air = [(3, occ.addCylinder(0, 0, -deep, 0, 0, deep, inner))]
        chambers, _ = occ.cut(air, [*walls, core])
        occ.cut([body], chambers)
        occ.addCylinder(0, 0, 0, 0, 0, self.flange, self.radius)

    @property
    def section(self) -> float:
        """Area [mm^2] of the cross-section of one chamber."""
        inner, half = self.radius - self.wall, 0.5 * self.partition
        beside = np.sqrt(inner**2 - half**2)
        quadrant = 0.5 * inner**2 * (0.5 * np.pi - 2.0 * np.arcsin(half / inner)) - half * (beside - half)
        return float(quadrant - 0.5 * (self.core - self.partition) ** 2)

    @property
    def volume(self) -> float:
        """Volume [mm^3] of the arm with its flange."""
        whole = np.pi * self.radius**2 * (self.length + self.flange)
        return float(whole - 4.0 * self.section * (self.length - self.solid))


def compared() -> Table:
    """Return the table of recorded and simulated displacements; a model's column ends with its last equilibrium."""
    data, limited = recorded(), {"solver.max_iterations": LIMIT}
    curves = {
        name: tips(load_scene(NAME, overrides=limited | given), step=STEP, most=MOST) for name, given in MODELS.items()
    }
    table = Table(title="displacement of the tip in mm, tilt of the end in degrees; one chamber under pressure")
    for column in ("mbar", "recorded", *curves, *(f"{name} / recorded" for name in curves)):
        table.add_column(column, justify="right")
    for pressure, total, tilt in zip(data["pressure"], data["total"], data["tilt"], strict=True):
        rows = [_at(curve, pressure) for curve in curves.values()]
        ratios = ["none" if row is None else f"{row[1] / total:.2f}" for row in rows]
        shown = ["none" if row is None else _text(*row[1:]) for row in rows]
        table.add_row(f"{pressure / MBAR:.0f}", _text(total, tilt), *shown, *ratios)
    return table


def _at(curve: NDArray[np.float64], pressure: float) -> NDArray[np.float64] | None:
    """Return the row of a curve at a pressure [Pa]; None if there is no equilibrium."""
    found = curve[np.isclose(curve[:, 0], pressure)]
    return found[0] if len(found) else None


def _text(total: float, tilt: float) -> str:
    return f"{1e3 * total:.2f}, {np.degrees(tilt):.1f}"


def main() -> None:
    """Draw the arm, write its mesh and its picture, and print the table."""
    write_mesh(Arm(), SCENES / f"{NAME}.vtu", size=SIZE)
    draw_scene(NAME, IMAGES / f"{NAME}.png")
    Console(width=110).print(compared())


if __name__ == "__main__":
    main()

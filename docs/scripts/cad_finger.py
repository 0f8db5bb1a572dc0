# SPDX-License-Identifier: Apache-2.0
"""A PneuNet finger from a parametric drawing: ``python -m docs.scripts.cad_finger`` draws, meshes and inflates it.

The drawing is written as STEP. `gdfe new` makes the scene. `gdfe inspect` and `gdfe solve` make the pictures of
docs/cad.md.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from docs.scripts.drawing import write_step
from gdfe_ros.cli import main as gdfe

ROOT = Path(__file__).resolve().parents[2]
PICTURE, WALLS = ROOT / "docs/images/cad_finger.png", ROOT / "docs/images/cad_walls.png"
PRESSURE, SIZE = 12e3, 0.005


@dataclass(frozen=True)
class Finger:
    """Dimensions [mm] of the finger: a row of chambers with gaps between them, above a common base with a channel.

    Attributes:
        chambers: number of chambers.
        pitch: distance from one chamber to the next.
        gap: width of the gaps between them.
        width, height: of the finger.
        wall: thickness of the chambers' walls.
        base: thickness of the base under the channel; the base stretches less than the chambers.
        channel: height and width of the channel that connects the chambers.
    """

    chambers: int = 6
    pitch: float = 12.0
    gap: float = 3.0
    width: float = 18.0
    height: float = 18.0
    wall: float = 2.0
    base: float = 4.0
    channel: float = 4.0

    @property
    def length(self) -> float:
        """Length [mm] of the finger."""
        return self.chambers * self.pitch + self.gap

    @property
    def volume(self) -> float:
        """Volume [mm^3] of the silicone: the box without gaps, chambers and channel."""
        tall = self.height - self.base - self.wall
        chamber = self._inside * (self.width - 2.0 * self.wall) * tall
        gap = self.gap * self.width * (self.height - self.base - self.channel - self.wall)
        between = (self.chambers - 1) * (self.pitch - self._inside) * self.channel**2
        whole = self.length * self.width * self.height
        return whole - (self.chambers + 1) * gap - self.chambers * chamber - between

    def draw(self, occ: Any) -> None:
        """Draw the finger along x, with its base at z = 0."""
        box, low, first = occ.addBox, -self.width / 2, self.gap + self.wall
        body = box(0, low, 0, self.length, self.width, self.height)
        over = self.base + self.channel + self.wall
        gaps = [
            (3, box(i * self.pitch, low, over, self.gap, self.width, self.height)) for i in range(self.chambers + 1)
        ]
        channel = self.channel
        holes = [(3, box(first, -channel / 2, self.base, self.length - 2 * first, channel, channel))]
        wide, tall = self.width - 2 * self.wall, self.height - self.base - self.wall
        for i in range(self.chambers):
            start = first + i * self.pitch
            holes.append((3, box(start, low + self.wall, self.base, self._inside, wide, tall)))
        occ.cut([(3, body)], gaps + holes)

    @property
    def _inside(self) -> float:
        """Length [mm] of a chamber along the finger."""
        return self.pitch - self.gap - 2.0 * self.wall


def main() -> None:
    """Draw the finger, inspect it, make the scene, solve it and write the pictures."""
    with tempfile.TemporaryDirectory() as folder:
        step, scene = Path(folder) / "finger.step", Path(folder) / "finger.yaml"
        write_step(Finger(), step)
        given = ["new", str(scene), "--from", str(step), "--size", str(SIZE), "--material", "dragon_skin_30"]
        rise = f"program.actuators.air_0=[{{time: 0, value: 0}}, {{time: 1, value: {PRESSURE}}}]"
        solved = ["solve", str(scene), "--set", rise, "--steps", "6", "--picture", str(PICTURE)]
        inspected = ["inspect", str(step), "--size", str(SIZE), "--picture", str(WALLS)]
        if gdfe(inspected) or gdfe(given) or gdfe(solved):
            raise SystemExit(1)


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""A PneuNet finger from a parametric drawing: ``python -m docs.scripts.cad_finger`` draws, meshes and inflates it.

The drawing is made by gmsh's CAD kernel, in millimetres, and written as STEP. `gdfe new` makes the scene.
`gdfe inspect` and `gdfe solve` make the pictures of docs/cad.md.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

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


def draw(finger: Finger, path: Path) -> None:
    """Write the finger as STEP. Call this in a separate process, because gmsh's licence requires it."""
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    box, length = gmsh.model.occ.addBox, finger.chambers * finger.pitch + finger.gap
    low, top = -finger.width / 2, finger.base + finger.channel
    body = box(0, low, 0, length, finger.width, finger.height)
    gaps = [
        (3, box(i * finger.pitch, low, top + finger.wall, finger.gap, finger.width, finger.height))
        for i in range(finger.chambers + 1)
    ]
    first = finger.gap + finger.wall
    holes = [(3, box(first, -finger.channel / 2, finger.base, length - 2 * first, finger.channel, finger.channel))]
    for i in range(finger.chambers):
        inside = finger.pitch - finger.gap - 2 * finger.wall
        start, tall = finger.gap + finger.wall + i * finger.pitch, finger.height - finger.base - finger.wall
        holes.append((3, box(start, low + finger.wall, finger.base, inside, finger.width - 2 * finger.wall, tall)))
    gmsh.model.occ.cut([(3, body)], gaps + holes)
    gmsh.model.occ.synchronize()
    gmsh.write(str(path))
    gmsh.finalize()


def main() -> None:
    """Draw the finger, inspect it, make the scene, solve it and write the pictures."""
    with tempfile.TemporaryDirectory() as folder:
        step, scene = Path(folder) / "finger.step", Path(folder) / "finger.yaml"
        code = f"from docs.scripts.cad_finger import *; draw(Finger(), Path({str(step)!r}))"
        subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
        given = ["new", str(scene), "--from", str(step), "--size", str(SIZE), "--material", "dragon_skin_30"]
        rise = f"program.actuators.air_0=[{{time: 0, value: 0}}, {{time: 1, value: {PRESSURE}}}]"
        solved = ["solve", str(scene), "--set", rise, "--steps", "6", "--picture", str(PICTURE)]
        inspected = ["inspect", str(step), "--size", str(SIZE), "--picture", str(WALLS)]
        if gdfe(inspected) or gdfe(given) or gdfe(solved):
            raise SystemExit(1)


if __name__ == "__main__":
    main()

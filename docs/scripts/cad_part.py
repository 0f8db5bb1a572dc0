# SPDX-License-Identifier: Apache-2.0
"""From STEP to a moving picture: ``python -m docs.scripts.cad_part`` runs three commands and prints their times.

The STEP file has a soft bar with three blind holes, and a plate that closes them. Wall times depend on what else the
machine does; processor times hardly do.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageSequence

from docs.scripts.drawing import IMAGES, write_step

COMMANDS = (
    "gdfe new part.yaml --from part.step",
    "gdfe demo part.yaml --dt 0.1 --out part",
    "gdfe report part --gif part.gif --frames 11",
)
WIDTH = 560
"""Width of the animation [px]."""


@dataclass(frozen=True)
class Part:
    """Dimensions [mm] of a bar along x with round blind holes in a row.

    Attributes:
        length, width, height: of the bar.
        holes: number of holes, which are open at x = 0.
        radius, deep: of a hole.
        above: height of the holes' axes; above the middle, so that the bar bends down under pressure.
        plate: thickness of the plate that closes the holes at x = 0.
    """

    length: float = 60.0
    width: float = 30.0
    height: float = 15.0
    holes: int = 3
    radius: float = 3.5
    deep: float = 56.0
    above: float = 10.0
    plate: float = 3.0

    @property
    def volume(self) -> float:
        """Volume [mm^3] of the bar and the plate."""
        whole = (self.length + self.plate) * self.width * self.height
        return float(whole - self.holes * np.pi * self.radius**2 * self.deep)

    def draw(self, occ: Any) -> None:
        """Draw the bar, and the plate as a second solid."""
        body = (3, occ.addBox(0, -0.5 * self.width, 0, self.length, self.width, self.height))
        places = [self.width * ((i + 0.5) / self.holes - 0.5) for i in range(self.holes)]
        occ.cut([body], [(3, occ.addCylinder(0, y, self.above, self.deep, 0, 0, self.radius)) for y in places])
        occ.addBox(-self.plate, -0.5 * self.width, 0, self.plate, self.width, self.height)


def timed(commands: Sequence[str], folder: Path) -> list[tuple[float, float]]:
    """Run commands of `gdfe` in a folder; return the wall time and the processor time [s] of each.

    Raises:
        subprocess.CalledProcessError: a command fails.
    """
    found = []
    for command in commands:
        began, used = time.monotonic(), _processor_time()
        words = [str(Path(sys.executable).with_name("gdfe")), *command.split()[1:]]
        subprocess.run(words, cwd=folder, check=True, capture_output=True)
        found.append((time.monotonic() - began, _processor_time() - used))
    return found


def _processor_time() -> float:
    """Return the processor time [s] of all ended child processes."""
    spent = os.times()
    return spent.children_user + spent.children_system


def _shrink(gif: Path, path: Path) -> None:
    """Write a GIF as a small WebP animation."""
    with Image.open(gif) as film:
        pictures = [frame.convert("RGB") for frame in ImageSequence.Iterator(film)]
    size = WIDTH, round(WIDTH * pictures[0].height / pictures[0].width)
    first, *others = (picture.resize(size, Image.Resampling.LANCZOS) for picture in pictures)
    first.save(path, save_all=True, append_images=others, duration=150, loop=0, quality=60)


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw the part, run the commands, and print the times of each; or only write the STEP file."""
    parser = argparse.ArgumentParser(description="From STEP to a moving picture.")
    parser.add_argument("--step", type=Path, metavar="FILE.step", help="only write the STEP file")
    if path := parser.parse_args(arguments).step:
        write_step(Part(), path)
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_step(Part(), folder / "part.step")
        times = timed(COMMANDS, folder)
        _shrink(folder / "part.gif", IMAGES / "cad_part.webp")
    rows = [*zip(COMMANDS, times, strict=True), ("from STEP to the moving picture", np.sum(times, axis=0))]
    for text, (wall, processor) in rows:
        print(f"{wall:5.1f} s, processor {processor:5.1f} s  {text}")


if __name__ == "__main__":
    main()

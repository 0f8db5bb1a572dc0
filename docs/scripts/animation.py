# SPDX-License-Identifier: Apache-2.0
"""The moving pictures of README and docs/: ``python -m docs.scripts.animation`` plays programs and draws them."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image

from gdfe_ros import Simulation, load_scene
from gdfe_ros.analysis.picture import draw_body
from gdfe_ros.analysis.report.motion import write_gif

IMAGES = Path(__file__).resolve().parents[1] / "images"
ROBOTS = ("three_chamber_arm", "gripper")
FRAMES, STEPS_A_FRAME = 24, 4
WIDTH = 560
"""Of a picture [pixels]: what the moving pictures of a page should load quickly."""


def draw(name: str) -> Path:
    """Play a scene's program in small steps and draw every few of them, coloured by equivalent strain."""
    simulation = Simulation(load_scene(name))
    states = [(simulation.positions.copy(), simulation.fields().eps_eq)]
    for number, result in enumerate(simulation.play(FRAMES * STEPS_A_FRAME), start=1):
        if not result.converged:
            raise RuntimeError(f"{name} at {result.time:g} s: {result.message}")
        if number % STEPS_A_FRAME == 0:
            states.append((result.positions.copy(), simulation.fields().eps_eq))
    around = np.array([corner for places, _ in states for corner in (places.min(axis=0), places.max(axis=0))])
    limits = 0.0, max(float(strain.max()) for _, strain in states)
    pictures = []
    for places, strain in states:
        buffer = BytesIO()
        options = {"title": "", "label": "equivalent strain", "limits": limits, "around": around}
        draw_body(buffer, simulation.mesh, places, strain, **options)
        picture = Image.open(buffer).convert("RGB")
        size = WIDTH, round(WIDTH * picture.height / picture.width)
        pictures.append(picture.resize(size, Image.Resampling.LANCZOS))
    return write_gif(pictures, IMAGES / f"{name}.gif")


def main() -> None:
    """Draw all of them."""
    for name in ROBOTS:
        path = draw(name)
        print(f"written: {path} ({path.stat().st_size / 1e3:.0f} kB)")


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""The animations of README and docs/: ``python -m docs.scripts.animation`` makes the runs and draws them.

They show robots that play their scene's program, and a bag above its replay.
"""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gdfe_ros import Simulation, load_scene
from gdfe_ros.analysis.bag_run import BagRun, BagSteps
from gdfe_ros.analysis.picture import draw_body
from gdfe_ros.analysis.replay import Replay
from gdfe_ros.mesh import HexMesh

ROOT = Path(__file__).resolve().parents[2]
IMAGES = ROOT / "docs" / "images"
ROBOTS = ("three_chamber_arm", "gripper", "tendon_finger")
BAG = "bend5_wall"
FRAMES, STEPS_A_FRAME = 24, 4
WIDTH = 560
"""Width of a picture [px]."""
SECONDS, QUALITY = 4.0, 60
"""Duration [s] and WebP quality of an animation; with this quality a file has a few hundred kilobytes."""

State = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Vertices (n, 3) [m] and equivalent strain of the cells (m,)."""


def draw_robot(name: str) -> Path:
    """Play a scene's program in small steps and draw every n-th step, coloured by equivalent strain."""
    simulation = Simulation(load_scene(name))
    states = [(simulation.positions.copy(), simulation.fields().eps_eq)]
    for number, result in enumerate(simulation.play(FRAMES * STEPS_A_FRAME), start=1):
        if not result.converged:
            raise RuntimeError(f"{name} at {result.time:g} s: {result.message}")
        if number % STEPS_A_FRAME == 0:
            states.append((result.positions.copy(), simulation.fields().eps_eq))
    return _write(_pictures(simulation.mesh, states, [""] * len(states)), name)


def draw_replay(bag: str) -> Path:
    """Draw every second step of a recorded run, above the same step of its replay."""
    run = BagRun(ROOT / "bags" / bag)
    replay = Replay(run)
    recorded, repeated, times = [], [], []
    for step, result in replay.steps(BagSteps(run)):
        mesh, strain = step.samples["mesh"], step.samples["strain"]
        recorded.append((np.stack([mesh[axis] for axis in "xyz"], axis=1).astype(float), strain["eps_eq"]))
        repeated.append((result.positions.astype(np.float32).astype(float), replay.simulation.fields().eps_eq))
        times.append(f"t = {result.time:.2f} s, solve cut after {result.cut_after} iterations")
    apart = [np.abs(one - other).max() for (one, _), (other, _) in zip(recorded, repeated, strict=True)]
    titles = [f"recorded by the node: {time}" for time in times]
    again = [f"replayed without ROS: farthest from the recorded vertices {distance:.1g} m" for distance in apart]
    above, below = (_pictures(run.scene.mesh, *each) for each in ((recorded, titles), (repeated, again)))
    return _write([_stack(pair) for pair in zip(above, below, strict=True)][::2], "replay")


def _pictures(mesh: HexMesh, states: Sequence[State], titles: Sequence[str]) -> list[Image.Image]:
    """Return pictures of states with one length scale and one colour scale."""
    around = np.array([corner for places, _ in states for corner in (places.min(axis=0), places.max(axis=0))])
    limits = 0.0, max(float(strain.max()) for _, strain in states)
    pictures = []
    for (places, strain), title in zip(states, titles, strict=True):
        buffer = BytesIO()
        options = {"title": title, "label": "equivalent strain", "limits": limits, "around": around}
        draw_body(buffer, mesh, places, strain, **options)
        picture = Image.open(buffer).convert("RGB")
        size = WIDTH, round(WIDTH * picture.height / picture.width)
        pictures.append(picture.resize(size, Image.Resampling.LANCZOS))
    return pictures


def _stack(pictures: Sequence[Image.Image]) -> Image.Image:
    """Return one picture with all pictures, which have the same size, below each other."""
    first = pictures[0]
    whole = Image.new("RGB", (first.width, first.height * len(pictures)))
    for place, picture in enumerate(pictures):
        whole.paste(picture, (0, place * first.height))
    return whole


def _write(pictures: Sequence[Image.Image], name: str) -> Path:
    """Write an animation that repeats forever."""
    path, (first, *others) = IMAGES / f"{name}.webp", pictures
    duration = round(1000 * SECONDS / len(pictures))
    first.save(path, save_all=True, append_images=others, duration=duration, loop=0, quality=QUALITY)
    return path


def main() -> None:
    """Draw all animations."""
    for path in [*map(draw_robot, ROBOTS), draw_replay(BAG)]:
        print(f"written: {path} ({path.stat().st_size / 1e3:.0f} kB)")


if __name__ == "__main__":
    main()

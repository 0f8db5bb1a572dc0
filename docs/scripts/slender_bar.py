# SPDX-License-Identifier: Apache-2.0
"""Animation of the iterations of a slender bar to its equilibrium, with and without the second level."""

from __future__ import annotations

from io import BytesIO
from unittest.mock import patch

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gdfe_ros import Simulation
from gdfe_ros.scene import scene_from_text
from gdfe_ros.solver.equilibrium import slender

SCENE = """
name: slender_bar
mesh: {bar: {size: [0.4, 0.008, 0.008], cells: [200, 2, 2]}}
materials: {rubber: {law: neo_hookean, young: 1.0e6, poisson: 0.45, density: 1000}}
regions: [{material: rubber}]
handles: {base: {where: {face: x-}, fixed: true}}
loads: {weight: {gravity: [0, 0, -0.25]}}
solver: {max_iterations: 5000}
"""
"""A bar whose length is 50 times its thickness; it sags by a third of its length."""
MOST, FRAMES = 2000, 40
"""Largest shown number of iterations, and number of pictures. Their iterations are evenly spaced in the logarithm."""
COLOURS = {"constant matrix and kept tangent": "#1b6ca8", "constant matrix alone": "#d1495b"}

Line = NDArray[np.float64]
"""Mean vertex positions of the cross-sections (s, 3) [m]."""


def draw_iterations() -> list[Image.Image]:
    """Draw the bar after increasing numbers of iterations of its first step, with both methods, and its equilibrium."""
    counts = np.unique(np.geomspace(1.0, MOST, FRAMES).astype(int))
    true, with_level = _bar(), _paths(_bar(), counts)
    with patch.object(slender, "SLENDER", 0.0):
        alone = _bar()
    paths = dict(zip(COLOURS, (with_level, _paths(alone, counts)), strict=True))
    result = true.step()
    if not result.converged:
        raise RuntimeError(result.message)
    end = _line(true)
    return [
        _picture(int(count), {name: path[k] for name, path in paths.items()}, end) for k, count in enumerate(counts)
    ]


def _bar() -> Simulation:
    return Simulation(scene_from_text(SCENE))


def _paths(simulation: Simulation, counts: NDArray[np.int64]) -> list[Line]:
    """Return the bar's line after each number of iterations; each solve continues the previous one."""
    lines, done, converged = [], 0, False
    for count in counts:
        if not converged:
            result = simulation.step(cut_after=int(count) - done, dt=0.0)
            done, converged = int(count), result.converged
        lines.append(_line(simulation))
    return lines


def _line(simulation: Simulation) -> Line:
    sections = np.unique(simulation.mesh.vertices[:, 0].round(9), return_inverse=True)[1].reshape(-1)
    weights = np.bincount(sections)
    return np.stack([np.bincount(sections, column) / weights for column in simulation.positions.T], axis=1)


def _picture(count: int, lines: dict[str, Line], end: Line) -> Image.Image:
    figure, axes = plt.subplots(figsize=(5.6, 3.0), layout="constrained")
    axes.plot(end[:, 0], end[:, 2], color="0.8", linewidth=6.0, label="equilibrium")
    for name, line in lines.items():
        away = np.linalg.norm(line[-1] - end[-1])
        axes.plot(line[:, 0], line[:, 2], color=COLOURS[name], label=f"{name}: tip off by {1e3 * away:.3g} mm")
    axes.set(xlim=(-0.01, 0.42), ylim=(-0.19, 0.06), aspect="equal", xlabel="x [m]", ylabel="z [m]")
    axes.set_title(f"after {count} iteration{'s' * (count > 1)}")
    axes.legend(loc="lower left", fontsize=8)
    buffer = BytesIO()
    figure.savefig(buffer, dpi=100)
    plt.close(figure)
    return Image.open(buffer).convert("RGB")

# SPDX-License-Identifier: Apache-2.0
"""A clamped round membrane with a rigid cap that lifts a weight: its mesh, its scene, and its pressure over height.

The published constants are those of Campbell et al. (2025): Ecoflex 00-30 and rings as bodies of Gent. Nothing is
fitted. The volume is commanded, because the pressure has a limit point.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from benchmarks.scenes import read_scene
from gdfe_ros import Command, Simulation
from gdfe_ros.scene import Scene, scene_from_text

Array = NDArray[np.float64]
CLAMPED = 70e-3
"""Radius at which the membrane is clamped [m]."""
LAWS = {
    "ecoflex": {"law": "gent", "mu": 31.7e3, "jm": 39.6, "poisson": 0.499},
    "ring": {"law": "gent", "mu": 1.0e6, "jm": 25.0, "poisson": 0.499},
}
AROUND, FINEST, COARSEST, GROWTH = 32, 0.5e-3, 2e-3, 1.3
"""Number of cells around the axis; smallest and largest cell along the radius [m], and the ratio of neighbours."""
FIRST, STEP = 0.03, 0.002
"""Volume without weight, and increment of the volume [m], over the area that lifts the cap."""


@dataclass(frozen=True, kw_only=True)
class Design:
    """Dimensions of a membrane [m].

    Attributes:
        thickness: thickness of the membrane and of its rings.
        cap: radius of the rigid cap.
        rings: mean radius and half of the width of each stiff ring, from the inside.
    """

    thickness: float
    cap: float
    rings: tuple[tuple[float, float], ...] = ()

    @property
    def lifting_area(self) -> float:
        """Area [m^2] by which the pressure of a membrane without stiffness lifts the cap from a cone."""
        return float(np.pi / 3.0 * (CLAMPED**2 + CLAMPED * self.cap + self.cap**2))

    def radii(self, *, finest: float = FINEST) -> Array:
        """Return the radii of the circles of vertices (k,) [m]; they are dense at clamps and at the edges of rings."""
        edges = [self.cap, *(r + s * half for r, half in self.rings for s in (-1, 1)), CLAMPED]
        parts = [_graded(a, b, finest) for a, b in pairwise(edges)]
        return np.concatenate([*parts, [CLAMPED]])


def membrane_scene(folder: Path, design: Design, *, around: int = AROUND, finest: float = FINEST) -> Scene:
    """Return the scene of a membrane: its actuator ``air`` takes a volume, its load ``weight`` is 1 N.

    Args:
        folder: folder into which the mesh is written.
        design: dimensions.
        around: number of cells around the axis; their polygons have the areas of the circles.
        finest: smallest cell along the radius [m].
    """
    radii = design.radii(finest=finest)
    count, angle = len(radii), 2.0 * np.pi / around
    swelled = radii * np.sqrt(angle / np.sin(angle))
    level = np.stack([np.outer(swelled, f(angle * np.arange(around))).ravel() for f in (np.cos, np.sin)], axis=1)
    points = np.vstack([np.column_stack([level, np.full(len(level), z)]) for z in (0.0, design.thickness)])
    i, j = (index.ravel() for index in np.meshgrid(np.arange(count - 1), np.arange(around), indexing="ij"))
    after = (j + 1) % around
    quads = np.column_stack([i * around + j, (i + 1) * around + j, (i + 1) * around + after, i * around + after])
    cells = np.hstack([quads, quads + len(level)])
    meshio.write(folder / "membrane.vtu", meshio.Mesh(points, [("hexahedron", cells)]))
    middles = 0.5 * (radii[:-1] + radii[1:])[i]
    stiff = np.any([np.abs(middles - r) < half for r, half in design.rings], axis=0) if design.rings else False
    ids = np.arange(len(points))
    circle = ids % len(level) // around
    regions: list[dict[str, Any]] = [{"material": "ecoflex"}]
    if np.any(stiff):
        regions.append({"material": "ring", "where": {"cells": np.flatnonzero(stiff).tolist()}})
    inner = {"vertices": ids[circle == 0].tolist()}
    given = {
        "mesh.file": str(folder / "membrane.vtu"),
        "materials": LAWS,
        "regions": regions,
        "handles.rim.where": {"vertices": ids[circle == count - 1].tolist()},
        "handles.cap.where": inner,
        "actuators.air.chamber.where": {"vertices": ids[: len(level)].tolist()},
        "loads.weight.surface.where": inner,
    }
    return scene_from_text(read_scene("membrane.yaml"), origin="of the membrane", overrides=given)


def lift(design: Design, weight: float, heights: Sequence[float], *, finest: float = FINEST) -> Array:
    """Return the pressures (k,) [Pa] at which a membrane holds a weight [N] at ascending heights (k,) [m].

    They are NaN for heights beyond the last equilibrium that was found.
    """
    with tempfile.TemporaryDirectory() as folder:
        simulation = Simulation(membrane_scene(Path(folder), design, finest=finest))
    step = STEP * design.lifting_area
    volume = FIRST * design.lifting_area
    for fraction in np.linspace(0.0, 1.0, 9)[1:]:
        simulation.step(Command(actuators={"air": fraction * volume}, loads={"weight": 0.0}))
    for fraction in np.linspace(0.0, 1.0, 9)[1:]:
        simulation.step(Command(loads={"weight": fraction * weight}))
    while _height(simulation) > heights[0]:
        volume -= step
        simulation.step(Command(actuators={"air": volume}))
    curve = [(_height(simulation), simulation.result.actuators["air"].effort)]
    while curve[-1][0] < heights[-1]:
        volume += step
        result = simulation.step(Command(actuators={"air": volume}))
        if not result.converged:
            break
        curve.append((_height(simulation), result.actuators["air"].effort))
    return PchipInterpolator(*np.array(curve).T, extrapolate=False)(heights)


def _height(simulation: Simulation) -> float:
    """Return the height of the cap above the clamp [m]."""
    return float(simulation.handle_pose("cap").translation[2])


def _graded(start: float, end: float, finest: float) -> Array:
    """Return the planes from start to before the end, whose distances grow from both sides to the middle."""
    half, steps = 0.5 * (end - start), [finest]
    while sum(steps) < half:
        steps.append(min(GROWTH * steps[-1], COARSEST))
    sums = np.concatenate([[0.0], np.cumsum(steps)]) * half / sum(steps)
    return np.concatenate([start + sums, (end - sums)[-2:0:-1]])

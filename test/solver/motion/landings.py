# SPDX-License-Identifier: Apache-2.0
"""Bodies that fall onto a floor, or are thrown at it, and the energy that they have then."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gdfe_ros import Simulation
from test.written import scene_of

SCENE = """
materials: {soft: {law: neo_hookean, poisson: 0.45, density: 1000}}
handles: {}
"""
CUBE = "{bar: {size: [0.04, 0.04, 0.04], cells: [4, 4, 4]}}"
BAR = "{bar: {size: [0.2, 0.02, 0.02], cells: [20, 2, 2]}}"
BALL = "{sphere: {inner: 0.03, outer: 0.04, cells: [6, 2]}}"
THROWN = """
mesh: {bar: {size: [0.1, 0.1, 0.1], cells: [4, 4, 4]}}
materials: {soft: {law: neo_hookean, young: 1.0e6, poisson: 0.4, density: 1000}}
handles: {}
solver: {tolerance: 1.0e-5}
"""
SPEED = 0.5
"""Speed of a thrown body [m/s]."""
WAYS = {"corner": (1.0, 1.0, 1.0), "edge": (0.0, 1.0, 1.0), "askew": (0.3, 0.5, 0.81), "face": (0.0, 0.0, 1.0)}
"""Dict from landing pose to the upward direction, in the frame of the body."""
GRAVITY = 9.81
"""Acceleration of gravity [m/s^2]."""


@dataclass(frozen=True, kw_only=True)
class Landing:
    """A body that falls onto a floor.

    Attributes:
        mesh: YAML text of the mesh.
        up: landing pose, a key of `WAYS`.
        young: Young's modulus [Pa].
        scheme: time integration scheme.
        step: time step [s].
        speed: initial downward speed [m/s].
        height: initial height of the lowest vertex above the floor [m].
        lasts: simulated time [s].
    """

    mesh: str = CUBE
    up: str
    young: float
    scheme: str = "generalised_alpha"
    step: float = 0.005
    speed: float = 0.0
    height: float = 0.002
    lasts: float = 0.1

    def simulation(self, **more: object) -> Simulation:
        """Return the simulation in its initial state; ``more`` are further scene keys, with ``__`` for a dot."""
        up = np.array(WAYS[self.up]) / np.linalg.norm(WAYS[self.up])
        keys: dict[str, object] = {
            "materials.soft.young": self.young,
            "dynamics": {"scheme": self.scheme, "step": self.step, "velocity": (-self.speed * up).tolist()},
            "loads": {"weight": {"gravity": (-GRAVITY * up).tolist()}},
            **{name.replace("__", "."): value for name, value in more.items()},
        }
        text = f"{SCENE}mesh: {self.mesh}\n"
        lowest = (scene_of(text, overrides=keys).mesh.vertices @ up).min()
        floor = {"plane": up.tolist(), "at": ((lowest - self.height) * up).tolist(), "fixed": True}
        return Simulation(scene_of(text, overrides={**keys, "obstacles": {"floor": floor}}))


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Result of a landing.

    Attributes:
        steps: number of steps.
        stopped: number of steps that simulated less than their duration.
        unconverged: number of steps that did not converge, stopped steps included.
        most: largest energy (kinetic + elastic + potential above the floor), divided by the initial energy.
        min_det: least volume ratio of a corner.
        iterations: mean number of iterations of a step.
        message: first message of a step; empty if there is none.
    """

    steps: int
    stopped: int
    unconverged: int
    most: float
    min_det: float
    iterations: float
    message: str


def landed(landing: Landing) -> Outcome:
    """Simulate a landing and return its result."""
    simulation, steps = landing.simulation(), round(landing.lasts / landing.step)
    mass = float(simulation.stepper.mass.sum())
    fallen = 0.5 * mass * landing.speed**2 + mass * GRAVITY * landing.height
    held, results, before, stopped = [], [], 0.0, 0
    for _ in range(steps):
        result = simulation.step()
        stopped += result.time - before < 0.999 * landing.step
        before = result.time
        energy = sum(result.energies[name] for name in ("kinetic", "elastic", "potential"))
        held.append((energy + mass * GRAVITY * landing.height) / fallen)
        results.append(result)
    return Outcome(
        steps=steps,
        stopped=stopped,
        unconverged=sum(not result.converged for result in results),
        most=max(held),
        min_det=min(result.min_det for result in results),
        iterations=sum(result.iterations for result in results) / steps,
        message=next((result.message for result in results if result.message), ""),
    )


def thrown(
    text: str, scheme: Mapping[str, object], young: float, step: float, phase: float, *, lowest: float
) -> Simulation:
    """Return a simulation of a body that flies towards a floor and reaches it after 1 + ``phase`` steps.

    Args:
        text: YAML text of the scene.
        scheme: keys of the scene's dynamics that select the scheme.
        young: Young's modulus of the material ``soft`` [Pa].
        step: time step [s].
        phase: fraction of a step, 0 to 1.
        lowest: height of the body's lowest point [m].
    """
    floor = {"plane": [0, 0, 1], "at": [0, 0, lowest - (1.0 + phase) * SPEED * step], "fixed": True}
    keys = {
        "materials.soft.young": young,
        "dynamics": {**scheme, "step": step, "velocity": [0.0, 0.0, -SPEED]},
        "obstacles": {"floor": floor},
    }
    return Simulation(scene_of(text, overrides=keys))

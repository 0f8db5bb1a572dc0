# SPDX-License-Identifier: Apache-2.0
"""Landings that press corners of elements flat: ``python -m benchmarks.landings [--only WORD] [--out FILE]``.

A cube falls onto its corner, its edge, or in an oblique pose. Modulus and time step are varied. Further bodies are
thrown faster. The table shows incomplete steps, steps that did not converge, and the energy of each run.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from time import process_time

import numpy as np

from benchmarks.markdown import markdown_table
from gdfe_ros import Simulation
from gdfe_ros.scene.loader import scene_from_text

SCENE = """
name: landing
materials: {soft: {law: neo_hookean, poisson: 0.45, density: 1000}}
regions: [{material: soft}]
handles: {}
"""
CUBE = "{bar: {size: [0.04, 0.04, 0.04], cells: [4, 4, 4]}}"
BAR = "{bar: {size: [0.2, 0.02, 0.02], cells: [20, 2, 2]}}"
BALL = "{sphere: {inner: 0.03, outer: 0.04, cells: [6, 2]}}"
WAYS = {"corner": (1.0, 1.0, 1.0), "edge": (0.0, 1.0, 1.0), "askew": (0.3, 0.5, 0.81), "face": (0.0, 0.0, 1.0)}
"""Dict from landing pose to the upward direction, in the frame of the body."""
SCHEMES = ("bdf2", "newmark", "generalised_alpha")
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
        lowest = (scene_from_text(text, overrides=keys).mesh.vertices @ up).min()
        floor = {"plane": up.tolist(), "at": ((lowest - self.height) * up).tolist(), "fixed": True}
        return Simulation(scene_from_text(text, overrides={**keys, "obstacles": {"floor": floor}}))


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Result of a landing.

    Attributes:
        steps: number of steps.
        stopped: number of steps that simulated less than their duration.
        unconverged: number of steps that did not converge, stopped steps included.
        most, least: largest and least energy (kinetic + elastic + potential above the floor), divided by the initial
            energy.
        min_det: least volume ratio of a corner.
        iterations: mean number of iterations of a step.
        seconds: processor time of all steps [s].
        message: first message of a step; empty if there is none.
    """

    steps: int
    stopped: int
    unconverged: int
    most: float
    least: float
    min_det: float
    iterations: float
    seconds: float
    message: str


def landed(landing: Landing) -> Outcome:
    """Simulate a landing and return its result."""
    simulation, steps = landing.simulation(), round(landing.lasts / landing.step)
    mass = float(simulation.stepper.mass.sum())
    fallen = 0.5 * mass * landing.speed**2 + mass * GRAVITY * landing.height
    held, results, before, stopped, started = [], [], 0.0, 0, process_time()
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
        least=min(held),
        min_det=min(result.min_det for result in results),
        iterations=sum(result.iterations for result in results) / steps,
        seconds=process_time() - started,
        message=next((result.message for result in results if result.message), ""),
    )


def cases() -> Iterator[tuple[str, Landing]]:
    """Yield name and landing: 72 landings of the cube at 2 m/s, and further landings."""
    for up in ("corner", "edge", "askew"):
        for young in (1e4, 1e5, 1e6, 1e8):
            for scheme in SCHEMES:
                for step in (0.002, 0.005):
                    name = f"cube on its {up}" if up != "askew" else "cube askew"
                    yield name, Landing(up=up, young=young, scheme=scheme, step=step, speed=2.0)
    yield "cube falls 10 mm on its corner", Landing(up="corner", young=1e5, height=0.01, lasts=0.3)
    for young in (3e4, 1e5, 1e6):
        yield "fast cube on its corner", Landing(up="corner", young=young, step=0.002, speed=5.0)
    for scheme in SCHEMES:
        yield "fast cube on its edge", Landing(up="edge", young=1e5, scheme=scheme, step=0.002, speed=5.0)
        yield "fast bar", Landing(mesh=BAR, up="askew", young=1e6, scheme=scheme, step=0.002, speed=5.0)
        yield "fast hollow ball", Landing(mesh=BALL, up="face", young=1e5, scheme=scheme, step=0.002, speed=5.0)


def table(found: Sequence[tuple[str, Landing, Outcome]]) -> str:
    """Return the results as a table; the steps and schemes of a body are in one row."""
    rows: dict[tuple[str, float, float], list[Outcome]] = {}
    for name, landing, outcome in found:
        rows.setdefault((name, landing.young, landing.speed), []).append(outcome)
    heads = (
        "landing", "Young's modulus [Pa]", "speed [m/s]", "runs", "steps that stopped", "steps not converged",
        "largest energy", "smallest energy", "smallest det F", "iterations per step",
    )  # fmt: skip
    lines = []
    for (name, young, speed), outcomes in rows.items():
        steps = sum(each.steps for each in outcomes)
        lines.append(
            [
                name,
                f"{young:.0e}",
                f"{speed:g}",
                str(len(outcomes)),
                f"{sum(each.stopped for each in outcomes)} of {steps}",
                str(sum(each.unconverged for each in outcomes)),
                f"{max(each.most for each in outcomes):.3f}",
                f"{min(each.least for each in outcomes):.2f}",
                f"{min(each.min_det for each in outcomes):.3f}",
                f"{sum(each.iterations * each.steps for each in outcomes) / steps:.0f}",
            ]
        )
    return markdown_table(heads, lines)


def as_json(name: str, landing: Landing, outcome: Outcome) -> Mapping[str, object]:
    """Return a landing and its result as plain JSON data."""
    numbers = {key: None if isinstance(value, float) and not math.isfinite(value) else value
               for key, value in asdict(outcome).items()}  # fmt: skip
    return {"name": name, **asdict(landing), **numbers}


def main() -> None:
    """Simulate all landings, print the table, and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="a word in the names of the landings that are made")
    parser.add_argument("--out", type=Path, help="where to write the figures as JSON")
    given, found = parser.parse_args(), []
    for name, landing in cases():
        if given.only in name:
            found.append((name, landing, landed(landing)))
            print(as_json(*found[-1]), flush=True)
    print(table(found))
    if given.out:
        given.out.parent.mkdir(parents=True, exist_ok=True)
        given.out.write_text(json.dumps([as_json(*each) for each in found], indent=1))


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""The scene `arm_grasp`: time of each phase, drift of the held box, efforts of the joints, energy balance of the arm.

``python -m benchmarks.arm_grasp`` prints the tables, for rigid and for yielding joints.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.markdown import markdown_table
from benchmarks.report import options, write_report
from gdfe_ros.arms.arm import Arm
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.result import StepResult

Vector = NDArray[np.float64]
PHASES = {
    "closes": (0.0, 1.2),
    "lifts": (1.2, 2.2),
    "carries aside": (2.2, 3.7),
    "holds": (3.7, 12.0),
    "puts down": (12.0, 13.2),
    "opens": (13.2, 14.5),
    "leaves": (14.5, 15.6),
}
"""Dict from phase to its start and end [s]."""
QUIET = (9.0, 12.0)
"""Start and end [s] of the interval in which the drift is measured: while the box is held, after all vibrations."""
GRAVITY = np.array([0.0, 0.0, -9.81])
SPRINGS = {
    **{name: {"stiffness": 20000.0, "damping": 40.0} for name in ("shoulder_pan", "shoulder_lift", "elbow")},
    **{name: {"stiffness": 5000.0, "damping": 5.0} for name in ("wrist_1", "wrist_2", "wrist_3")},
}
"""Springs of the joints in the runs with yielding joints."""
KINDS: dict[str, dict[str, Any]] = {"rigid": {}, "yielding": {"arm.compliance": SPRINGS}}
"""Dict from kind of joints to the overrides of the scene."""
KIND_HEADS = ("iterations per step", "processor time / simulated time")
"""Headings of the two columns that each kind of joints has."""
PROBED = 60
"""Number of steps of a probe."""


def measure(overrides: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Play the program of the scene and return what was measured.

    Returns:
        ``rows``, for each phase: name, duration [s], mean iterations, processor time divided by simulated time;
        ``factor``: this ratio for the whole program; ``converged``; ``drift`` of the held box [m/s]; ``effort error``:
        result of `effort_error` while the box is held; ``balance``: error of the energy balance, divided by the work of
        the motors; ``work`` of the motors [J]; ``sag``: largest distance [rad] of a joint from its goal at the end.
    """
    simulation = Simulation(load_scene("arm_grasp", overrides=overrides))
    simulation.warm_up()
    account, rows, converged, places, error = Account(simulation), [], True, {}, 0.0
    plays = simulation.play(round(simulation.scene.program.duration / simulation.scene.dynamics.step))
    for phase, (_, last) in PHASES.items():
        iterations, times = [], []
        while simulation.time < last - 1e-6:
            began = time.process_time()
            result = next(plays)
            times.append(time.process_time() - began)
            iterations.append(result.iterations)
            converged &= result.converged
            account.add(result)
            places[round(result.time, 6)] = _place(simulation)
        if phase == "holds":
            error = effort_error(simulation, result)
        lasts = last - PHASES[phase][0]
        rows.append([phase, lasts, float(np.mean(iterations)), sum(times) / lasts])
    first, last = QUIET
    drift = float(np.linalg.norm(places[last] - places[first])) / (last - first)
    factor = sum(row[1] * row[3] for row in rows) / simulation.time
    found = {"rows": rows, "factor": factor, "converged": converged, "drift": drift, "effort error": error}
    sag = max(abs(simulation.joint_goals[name] - at) for name, at in simulation.joint_positions.items())
    return {**found, "balance": account.error, "work": account.motors, "sag": sag}


def effort_error(simulation: Simulation, result: StepResult) -> float:
    """Return the largest error of the efforts compared with those of point weights, divided by the largest effort.

    The arm must not move. The point weights are those of each link, the hand and the box, at their centres of mass. A
    weight m g at p needs the effort -m g . dp/dq, where dp/dq is a central difference of the positions of the links.
    This check uses neither the Newton-Euler algorithm nor the wrench of the hand.
    """
    arm = simulation.scene.arms[0]
    states = simulation.joint_states()
    q = np.array([states[joint.name].position for joint in arm.joints])
    carried, mass = _carried_mass(simulation, result)
    flange = arm.dynamics.frames(q)[arm.flange]
    local = flange.axes.T @ (carried - flange.origin)

    def lift(at: Vector) -> float:
        """Return minus the potential energy [J] of all weights, at joint positions ``at`` (n,)."""
        frame = arm.dynamics.frames(at)[arm.flange]
        held = mass * GRAVITY @ (frame.origin + frame.axes @ local)
        return float(held - arm.dynamics.potential_energy(at, GRAVITY))

    step, expected = 1e-5, np.empty(len(q))
    for i in range(len(q)):
        ahead, behind = q.copy(), q.copy()
        ahead[i], behind[i] = q[i] + step, q[i] - step
        expected[i] = -(lift(ahead) - lift(behind)) / (2.0 * step)
    found = np.array([states[joint.name].effort for joint in arm.joints])
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def _carried_mass(simulation: Simulation, result: StepResult) -> tuple[Vector, float]:
    """Return the centre of mass (3,) [m] and the mass [kg] of the hand together with the rigid bodies that it holds."""
    scene = simulation.scene
    masses = np.zeros(scene.mesh.n_vertices)
    densities = np.array([material.density for material in scene.materials.values()])[scene.cell_material]
    volumes = simulation.stepper.body.shape.volume
    np.add.at(masses, scene.mesh.cells, (densities * volumes / 8.0)[:, None])
    moment, total = masses @ result.positions, float(masses.sum())
    for each in scene.rigid_bodies:
        place = np.add(each.origin, simulation.handle_pose(each.name).translation)
        moment, total = moment + each.mass * place, total + each.mass
    return moment / total, total


def _place(simulation: Simulation) -> Vector:
    return np.array(simulation.handle_pose("part").translation)


@dataclass
class Account:
    """Energy balance of an arm: work of the motors, energy of the links, and work of the links on the hand.

    Attributes:
        simulation: simulation that is stepped.
        motors: sum of the magnitudes of the works of all motors and steps so far [J].
        net: work of all motors [J].
        hand: work of the handle on the hand [J].
    """

    simulation: Simulation
    motors: float = 0.0
    net: float = 0.0
    hand: float = 0.0
    _last: tuple[Vector, Vector, Vector, Vector] | None = field(default=None)
    _start: float = 0.0
    _now: float = 0.0

    @property
    def arm(self) -> Arm:
        """Arm of the scene."""
        return self.simulation.scene.arms[0]

    @property
    def error(self) -> float:
        """Error of the energy balance, divided by the work of the motors."""
        return abs(self.net - self.hand - (self._now - self._start)) / self.motors

    def add(self, result: StepResult) -> None:
        """Add the works of one step, by the trapezoidal rule."""
        states = list(self.simulation.joint_states().values())
        q, v, efforts = (
            np.array([getattr(state, name) for state in states]) for name in ("position", "velocity", "effort")
        )
        centre = self.arm.centre + self.simulation.targets[self.arm.handle].translation
        wrench = result.reactions[self.arm.handle]
        energy = self.arm.dynamics.kinetic_energy(q, v) + self.arm.dynamics.potential_energy(q, GRAVITY)
        turn = np.array(self.simulation.targets[self.arm.handle].rotation)
        pose = np.concatenate([centre, turn])
        if self._last is None:
            self._start = energy
        else:
            q0, efforts0, wrench0, pose0 = self._last
            works = 0.5 * (efforts + efforts0) * (q - q0)
            self.motors += float(np.abs(works).sum())
            self.net += float(works.sum())
            self.hand += float(0.5 * (wrench + wrench0) @ (pose - pose0))
        self._last, self._now = (q, efforts, wrench, pose), energy


def probe() -> dict[str, float]:
    """Return iterations and height of the hand in the first steps of the lift, for each kind of joints."""
    found: dict[str, float] = {}
    for kind, overrides in KINDS.items():
        simulation = Simulation(load_scene("arm_grasp", overrides=overrides))
        results = [simulation.step(dt=simulation.scene.dynamics.step) for _ in range(PROBED)]
        found[f"{kind}: iterations"] = sum(result.iterations for result in results)
        found[f"{kind}: height [m]"] = float(results[-1].positions[:, 2].mean())
    return found


def all_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return dict from name to table of a report."""
    heads = ("phase", "duration [s]", *(f"{KIND_HEADS[0]}, {kind}" for kind in KINDS))
    heads += tuple(f"{KIND_HEADS[1]}, {kind}" for kind in KINDS)
    runs = [report[kind] for kind in KINDS]
    rows = [
        [
            name,
            f"{lasts:.1f}",
            *(f"{run['rows'][i][2]:.1f}" for run in runs),
            *(f"{run['rows'][i][3]:.2f}" for run in runs),
        ]
        for i, (name, lasts, *_) in enumerate(runs[0]["rows"])
    ]
    whole = sum(row[1] for row in runs[0]["rows"])
    rows.append(["all", f"{whole:.1f}", *[""] * len(runs), *(f"{run['factor']:.2f}" for run in runs)])
    solved = [report[f"{kind}, all solved"] for kind in KINDS]
    sound = [run["converged"] and other["converged"] for run, other in zip(runs, solved, strict=True)]
    values = [
        ["every step converged", *("yes" if each else "no" for each in sound)],
        ["drift of the held box [um/s]", *(f"{1e6 * run['drift']:.1g}" for run in solved)],
        ["largest error of an effort at rest, over the largest effort [%]",
         *(f"{100 * run['effort error']:.1g}" for run in solved)],
        ["work of the motors that is not found in the links or on the hand [%]",
         *(f"{100 * run['balance']:.2f}" for run in solved)],
        ["largest distance of a joint from its goal at the end [mrad]", *(f"{1e3 * run['sag']:.2f}" for run in solved)],
    ]  # fmt: skip
    return {
        "arm_phases": markdown_table(heads, rows),
        "arm_quantities": markdown_table(("quantity", *(f"{kind} joints" for kind in KINDS)), values),
    }


def main() -> None:
    """Run the measurement, write the report and print the tables; in further runs no solve is skipped."""
    given = options("benchmarks.arm_grasp", "A hand on an arm picks a box.", "arm_grasp").parse_args()
    report = {kind: measure(overrides) for kind, overrides in KINDS.items()}
    report |= {f"{kind}, all solved": measure({**overrides, "solver.skip": []}) for kind, overrides in KINDS.items()}
    write_report(given.out, report, probe())
    print("\n\n".join(all_tables(report).values()))


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""Group 2: extreme commands that no controller should send, in one step."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks.torture.bodies import BAR, COMPRESSIBLE, CUBE, LAWS, Driver, distance, laws_for, make_scene
from benchmarks.torture.case import Case, Finding, Group
from gdfe_ros.constraints import Pose
from gdfe_ros.mesh import HexMesh
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.solver.settings import Policy

TOLERANCE = 1e-6
STEPS = 40
"""Number of steps of the slow load path with which a single step is compared."""
MOST_ITERATIONS = 10000
DISTURBANCE = 1e-3
"""Standard deviation of the random disturbance of vertices, divided by the body's size."""


@dataclass(frozen=True)
class Blow:
    """Extreme commands, each in one step.

    Attributes:
        mesh: mesh of the body.
        poses: successive poses of the tip, each in one step.
        unique: laws for which the policy ``energy`` must reach the final state of its slow load path. With all other
            laws the body buckles, writhes or necks, so that there are several equilibria; then only soundness is
            required.
        mirrored: those laws in ``unique`` with which the body has several equilibria, most of which are mirror images.
            Their energies are compared instead of positions. (A bar twisted by a revolution bows to one of its sides. A
            bar stretched to several lengths, with few cells across, winds to the left or to the right.) If the energies
            differ, the found equilibrium must be a minimum: after a disturbance the body must return to it.
        spread: for the policy ``relative``, largest distance from the equilibrium of the policy ``energy``, divided by
            the body's size. Its captured shapes (Eq. 9) depend on the path, and on a slow one elements may fold. It is
            infinite if only soundness or a report is required: far beyond the paper's deformations, the iteration of
            this policy need not converge, because it minimises no energy.
        report: for the policy ``relative``, a law and words of the report that is expected with it.
    """

    mesh: HexMesh
    poses: tuple[Pose, ...]
    unique: tuple[str, ...] = tuple(LAWS)
    mirrored: tuple[str, ...] = ()
    spread: float = 0.05
    report: tuple[str, str] = ("", "")


def _jumps() -> tuple[Pose, ...]:
    """Return random poses up to a body length apart, and finally the rest pose."""
    random = np.random.default_rng(11)
    places = random.uniform(-1.0, 1.0, (6, 3)) * (0.1, 0.3, 0.3) + (0.1, 0.0, 0.0)
    turns = random.uniform(-1.5, 1.5, (6, 3))
    jumps = [Pose(tuple(place), tuple(turn)) for place, turn in zip(places, turns, strict=True)]
    return (*jumps, Pose())


def _twist(degrees: float) -> tuple[Pose, ...]:
    return (Pose(rotation=(np.deg2rad(degrees), 0.0, 0.0)),)


BLOWS: dict[str, Blow] = {
    "twist by 90 degrees": Blow(BAR, _twist(90.0)),
    "twist by 180 degrees": Blow(BAR, _twist(180.0)),
    "twist by 360 degrees": Blow(BAR, _twist(360.0), unique=COMPRESSIBLE, mirrored=("ogden",)),
    "twist by 720 degrees": Blow(BAR, _twist(720.0), unique=(), spread=np.inf),
    "bend by 180 degrees": Blow(BAR, (Pose((-0.27, 0.0, 0.25), (0.0, -np.pi, 0.0)),), spread=0.1),
    "stretch to 400 %": Blow(
        BAR, (Pose((1.2, 0.0, 0.0)),), unique=("neo-hookean", "ogden"), mirrored=("neo-hookean", "ogden"), spread=0.2
    ),
    "compress to 20 %": Blow(
        CUBE, (Pose((-0.08, 0.0, 0.0)),), unique=(), spread=np.inf, report=("linear", "inside out")
    ),
    "random jumps of a body length": Blow(BAR, _jumps(), spread=np.inf),
}


def _run(blow: Blow, law: str, policy: Policy, bound: float) -> Finding:
    options = {"tolerance": TOLERANCE, "max_iterations": MOST_ITERATIONS}
    driver = Driver(make_scene(blow.mesh, LAWS[law], policy=policy, **options))
    for pose in blow.poses:
        driver.step(pose)
    error = np.nan
    if np.isfinite(bound):
        exact = Driver(make_scene(blow.mesh, LAWS[law], policy=Policy.ENERGY, **options))
        expected, found = exact.follow(blow.poses[-1], STEPS), driver.results[-1]
        error = distance(found.positions, expected.positions, blow.mesh.size)
        if policy is Policy.ENERGY and law in blow.mirrored:
            error = abs(found.energy / expected.energy - 1.0)
            if error > bound:
                error = abs(_disturbed(driver).energy / found.energy - 1.0)
    return Finding(tuple(driver.results), error, driver.rise)


def _disturbed(driver: Driver) -> StepResult:
    """Displace every free vertex of the last result at random, and return the result of the next step."""
    simulation, last = driver.simulation, driver.results[-1]
    shifts = np.zeros_like(last.positions)
    held = np.concatenate([handle.vertices for handle in simulation.scene.handles])
    free = np.setdiff1d(np.arange(len(shifts)), held)
    shifts[free] = np.random.default_rng(0).standard_normal((len(free), 3))
    simulation.set_positions(last.positions + DISTURBANCE * simulation.mesh.size * shifts)
    return simulation.step()


def _case(name: str, blow: Blow, law: str, policy: Policy) -> Case:
    closeness = 1e-4 if law in blow.unique else np.inf
    bound = blow.spread if policy is Policy.RELATIVE else closeness
    refusal = blow.report[1] if policy is Policy.RELATIVE and law == blow.report[0] else ""
    return Case(
        group=Group.COMMANDS,
        name=name,
        policy=policy,
        law=law,
        run=partial(_run, blow, law, policy, bound),
        bound=bound,
        refusal=refusal,
        may_report=law not in blow.unique if policy is Policy.ENERGY else bool(np.isinf(blow.spread)),
    )


def cases() -> list[Case]:
    """Return the cases of the group with extreme commands."""
    return [
        _case(name, blow, law, policy) for policy in Policy for name, blow in BLOWS.items() for law in laws_for(policy)
    ]

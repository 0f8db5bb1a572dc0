# SPDX-License-Identifier: Apache-2.0
"""Group 8: chambers, cables, growth and loads, commanded through limit points, to zero and to absurdly large values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.torture.bodies import Driver, distance
from benchmarks.torture.case import Case, Finding, Group
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.solver.settings import Policy

TOLERANCE = 1e-6
LAWS = {
    "neo-hookean, nu 0.495": "{law: neo_hookean, young: 1.0e6, poisson: 0.495, density: 1.1e3}",
    "linear": "{law: linear, young: 1.0e6, poisson: 0.3, density: 1.1e3}",
    "curve": "{law: curve, strain: [0.2, 1.0, 3.0], stress: [2.0e5, 8.0e5, 3.0e6], poisson: 0.45, density: 1.1e3}",
}
BALL = """
mesh: {sphere: {inner: 0.010, outer: 0.015, cells: [4, 3]}}
handles: {base: {where: {box: {x: [0.0130, 0.02]}}, fixed: true}}
"""
BEAM = """
mesh: {bar: {size: [0.10, 0.02, 0.02], cells: [10, 2, 2]}}
handles: {base: {where: {face: x-}, fixed: true}}
"""
SEED = """
mesh: {bar: {size: [0.04, 0.02, 0.02], cells: [4, 2, 2]}}
handles: {base: {where: {vertices: [0]}, fixed: true}}
"""
LOST = "lost its stability"
CLAMPED = BEAM.replace("fixed: true}}", "fixed: true}, tip: {where: {face: x+}, fixed: true}}")
CABLE = "cable: {{points: [[0.0, 0.0, 0.008], [0.05, 0.0, 0.008], [0.10, 0.0, 0.008]], command: {mode}}}"


@dataclass(frozen=True)
class Drive:
    """A body with one actuator or load, and its commands.

    Attributes:
        body: YAML text of mesh and handles.
        actuators: YAML text of one actuator `a`; empty if there is a load `a` instead.
        values: successive commands.
        back: if finite, the last command is neutral, and this is the largest allowed distance of a vertex from its
            undeformed position, divided by the body's size.
        share: whether the values are multiples of the neutral command, e.g. of a chamber's undeformed volume.
        refusal: words of the expected report; empty if an equilibrium is expected.
        may_report: whether a report is accepted instead of an equilibrium.
        loads: YAML text of one load `a`.
        slow: number of steps of a slow load path; its final state is compared with the last state. 0 for no comparison.
    """

    body: str
    actuators: str
    values: Sequence[float]
    back: float = np.inf
    share: bool = False
    refusal: str = ""
    may_report: bool = False
    loads: str = ""
    slow: int = 0


DRIVES: dict[str, Drive] = {
    "pressure beyond the limit point": Drive(
        BALL, "chamber: {command: pressure}", (5e4, 5e6), refusal=LOST
    ),
    "pressure in small steps through the limit point": Drive(
        BALL, "chamber: {command: pressure}", tuple(np.linspace(1e4, 6e5, 60)), refusal=LOST
    ),
    "vacuum of 10 bar": Drive(BALL, "chamber: {command: pressure}", (-1e6,), may_report=True),
    "pressure to and fro": Drive(BALL, "chamber: {command: pressure}", (4e4, -4e4, 6e4, 0.0), back=1e-4),
    "volume past the limit point and back": Drive(
        BALL, "chamber: {command: volume}", (4.0, 8.0, 1.0), back=1e-4, share=True
    ),
    "volume to nothing": Drive(BALL, "chamber: {command: volume}", (0.5, 0.1, 0.0), share=True, may_report=True),
    "volume below nothing": Drive(BALL, "chamber: {command: volume}", (-0.5,), share=True, refusal="allowed: 0 to"),
    "tension on and off": Drive(BEAM, CABLE.format(mode="tension"), (0.0, 5.0, 0.0, 20.0, 0.0), back=1e-4),
    "tension in one step": Drive(BEAM, CABLE.format(mode="tension"), (20.0,), slow=20),
    "tension of a tonne": Drive(BEAM, CABLE.format(mode="tension"), (1e4,), may_report=True),
    "slack, taut, slack": Drive(BEAM, CABLE.format(mode="length"), (1.2, 0.9, 1.1, 0.8, 1.0), back=1e-4, share=True),
    "length in one step": Drive(BEAM, CABLE.format(mode="length"), (0.85,), share=True, slow=20),
    "length of nothing": Drive(BEAM, CABLE.format(mode="length"), (0.0,), share=True, may_report=True),
    "shortened and let go": Drive(BEAM, CABLE.format(mode="shortening"), (0.02, -0.02, 0.01, 0.0), back=1e-4),
    "a hundred times its weight": Drive(BEAM, "", (100.0, -100.0, 0.0), back=1e-4, loads="gravity: [0, 0, -9.81]"),
    "a million times its weight": Drive(BEAM, "", (1e6,), may_report=True, loads="gravity: [0, 0, -9.81]"),
}  # fmt: skip
GROWTHS: dict[str, Drive] = {
    "growth to three times and a third": Drive(SEED, "growth: {stretch: [3.0, 0.33, 1.5]}", (1.0, 0.0), back=1e-5),
    "growth against handles": Drive(CLAMPED, "growth: {stretch: [1.0, 1.0, 1.6]}", (0.5, 1.0, 0.0), back=1e-4),
}


def scene_text(drive: Drive, law: str, policy: Policy) -> str:
    """Return the scene of a drive as YAML."""
    what, entry = ("actuators", drive.actuators) if drive.actuators else ("loads", drive.loads)
    driven = f"{what}: {{a: {{{entry}}}}}\n"
    return (
        f"name: torture\n{drive.body}materials: {{m: {LAWS[law]}}}\nregions: [{{material: m}}]\n{driven}"
        f"solver: {{tolerance: {TOLERANCE:.1e}, policy: {policy.value}, max_iterations: 5000}}\n"
    )


def _run(drive: Drive, law: str, policy: Policy) -> Finding:
    scene = scene_from_text(scene_text(drive, law, policy))
    driver = Driver(scene)
    size = scene.mesh.size
    for value in drive.values:
        _drive(driver, drive, value)
        if not driver.results[-1].converged and (drive.refusal or drive.may_report):
            break
    error = np.nan
    if np.isfinite(drive.back):
        error = distance(_aligned(driver.results[-1].positions, scene.mesh.vertices), scene.mesh.vertices, size)
    elif drive.slow:
        slow = Driver(scene)
        for step in range(drive.slow):
            _drive(slow, drive, _between(driver, drive, (step + 1) / drive.slow))
        error = distance(driver.results[-1].positions, slow.results[-1].positions, size)
    return Finding(tuple(driver.results), error, driver.rise)


def _aligned(found: NDArray[np.float64], expected: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the positions ``found`` after the rigid motion that fits them best to ``expected``.

    A body that is fixed at a single vertex can rotate freely about it.
    """
    centre, target = found.mean(axis=0), expected.mean(axis=0)
    turn, _ = Rotation.align_vectors(expected - target, found - centre)
    return turn.apply(found - centre) + target


def _between(driver: Driver, drive: Drive, fraction: float) -> float:
    begin = 1.0 if drive.share else 0.0
    return begin + fraction * (drive.values[-1] - begin)


def _drive(driver: Driver, drive: Drive, value: float) -> None:
    if not drive.actuators:
        driver.step(loads={"a": value})
        return
    neutral = driver.neutral["a"] if drive.share else 1.0
    driver.step(actuators={"a": value * neutral})


def cases() -> list[Case]:
    """Return the cases of the group with these actuators and loads."""
    found = []
    for name, drive in (*DRIVES.items(), *GROWTHS.items()):
        for law in LAWS:
            if law == "curve" and drive.refusal == LOST:
                continue  # it stiffens enough to have no limit point
            found.append(_case(name, drive, law, Policy.ENERGY))
    for name, drive in GROWTHS.items():
        found.append(_case(name, drive, "linear", Policy.RELATIVE))
    name = "tension under a policy without newtons"
    drive = replace(DRIVES["tension on and off"], back=np.inf, refusal="has no forces")
    return [*found, _case(name, drive, "linear", Policy.RELATIVE)]


def _case(name: str, drive: Drive, law: str, policy: Policy) -> Case:
    bound = drive.back if np.isfinite(drive.back) else 1e-3 if drive.slow else np.inf
    if policy is Policy.RELATIVE:
        bound = max(bound, 5e-2)
    return Case(
        group=Group.ACTUATORS,
        name=name,
        policy=policy,
        law=law,
        run=partial(_run, drive, law, policy),
        bound=bound,
        refusal=drive.refusal,
        may_report=drive.may_report,
    )

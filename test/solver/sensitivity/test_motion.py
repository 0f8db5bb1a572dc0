# SPDX-License-Identifier: Apache-2.0
"""Exact derivatives along motions of ten steps against central differences of motions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.errors import CommandError, GdfeError
from gdfe_ros.scene import scene_from_text
from test.solver.sensitivity.test_equilibrium import cable, largest_share, with_actuator
from test.written import advance

BAR = with_actuator(cable("tension")).replace("[8, 3, 3]", "[6, 2, 2]").replace("1.0e-10", "1.0e-9")
BAR += "dynamics: {step: 0.005, damping: {viscosity: 100.0, mass: 1.0}}\n"
STEPS, NEAR, NOISE = 10, 1e-4, 1e-8
PULL = Command(actuators={"a": 0.3})
Case = tuple[str, Callable[[float], tuple[Command, dict[str, Any]]], float, dict[str, Any]]


def soft(key: str, value: float) -> Callable[[float], tuple[Command, dict[str, Any]]]:
    """Return a function from a change to the pull command and the soft material's override ``key: value + change``."""
    return lambda change: (PULL, {f"materials.soft.{key}": value + change})


def damped(**given: Any) -> dict[str, Any]:
    """Return dynamics settings with steps of 5 ms."""
    return {"dynamics": {"step": 0.005, **given}}


def posed(change: float) -> tuple[Command, dict[str, Any]]:
    """Return a command in which the base is raised and rotated, with the rotation about y changed by ``change``."""
    return Command(handles={"base": Pose((0.0, 0.0, 0.01), (0.1, -0.2 + change, 0.3))}), {}


def branches(change: float) -> list[dict[str, float]]:
    """Return a Prony series."""
    return [{"share": 0.3 + change, "time": 0.02}, {"share": 0.2, "time": 0.1}]


CABLE = "actuators.a.cable.command"
CASES: Mapping[str, Case] = {
    "modulus": ("materials.soft.young", soft("young", 1e5), 1e3, {}),
    "density": ("materials.soft.density", soft("density", 1100.0), 11.0, {}),
    "bdf2": ("materials.soft.young", soft("young", 1e5), 1e3, damped(scheme="bdf2")),
    "newmark": ("materials.soft.young", soft("young", 1e5), 1e3, damped(scheme="newmark")),
    "volume": (
        "materials.soft.poisson",
        soft("poisson", 0.495),
        5e-5,
        {"materials.soft.poisson": 0.495, "solver.tolerance": 1e-10},
    ),
    "tension": ("actuators.a", lambda change: (Command(actuators={"a": 0.3 + change}), {}), 3e-3, {}),
    "shortening": (
        "actuators.a",
        lambda change: (Command(actuators={"a": 0.004 + change}), {}),
        1e-4,
        {CABLE: "shortening", "materials.stiff.law": "linear", "materials.soft.law": "linear"},
    ),
    "load": ("loads.weight", lambda change: (Command(loads={"weight": 1.0 + change}), {}), 1e-2, {}),
    "pose": ("handles.base.ry", posed, 1e-3, {}),
    "viscosity": (
        "dynamics.viscosity",
        lambda change: (PULL, damped(damping={"viscosity": 100.0 + change, "mass": 1.0})),
        1.0,
        {},
    ),
    "drag": (
        "dynamics.mass_damping",
        lambda change: (PULL, damped(damping={"viscosity": 100.0, "mass": 1.0 + change})),
        1e-2,
        {},
    ),
    "relaxation": (
        "dynamics.prony.0.share",
        lambda change: (PULL, damped(prony=branches(change))),
        3e-3,
        damped(prony=branches(0.0)),
    ),
}  # fmt: skip


def moved(command: Command, overrides: dict[str, Any], followed: str = "", dt: float | None = None) -> Simulation:
    """Return a simulation after ten steps, with one parameter followed if ``followed`` names it."""
    simulation = Simulation(scene_from_text(BAR, overrides=overrides))
    if followed:
        simulation.follow([followed])
    advance(simulation, command, dt=dt, count=STEPS)
    return simulation


def seen(simulation: Simulation) -> np.ndarray:
    """Return the probes [m] and the reactions at the base [N, N m], (12,)."""
    return np.concatenate([*simulation.probe_positions().values(), simulation.result.reactions["base"]])


def motion_error(case: Case, dt: float | None = None) -> float:
    """Return the largest error of a derivative along a motion, as `worst_error`."""
    name, beside, step, overrides = case
    simulation = moved(beside(0.0)[0], overrides, name, dt)
    exact = simulation.sensitivities(["probes.tip", "probes.edge", "reactions.base"]).matrix[:, 0]
    found = {}
    for change in (step, -step, 2.0 * step, -2.0 * step):
        command, more = beside(change)
        found[change] = seen(moved(command, {**overrides, **more}, dt=dt))
    near, far = ((found[h] - found[-h]) / (2.0 * h) for h in (step, 2.0 * step))
    difference = (4.0 * near - far) / 3.0
    noise = NOISE * np.abs(found[step][6:]).max() / step
    parts = (slice(0, 6), 0.0), (slice(6, 9), noise), (slice(9, 12), noise)
    return largest_share(exact, difference, NEAR, parts)


@pytest.mark.parametrize("case", CASES)
def test_motions(case: str) -> None:
    """Derivatives by materials, damping, commands, loads and poses equal differences after ten steps of each scheme."""
    assert motion_error(CASES[case]) <= 1.0


def test_steps_that_are_cut() -> None:
    """Derivatives by the base's pose equal differences in steps that are divided into three internal steps."""
    assert motion_error(CASES["pose"], dt=0.012) <= 1.0


@pytest.mark.parametrize(("key", "value", "step"), [("young", 1e5, 100.0), ("density", 1100.0, 0.1)])
@pytest.mark.parametrize("friction", [0.0, 0.1, 2.0])
@pytest.mark.parametrize("scheme", ["bdf2", "generalised_alpha"])
def test_contact_in_motion(friction: float, scheme: str, key: str, value: float, step: float) -> None:
    """With a ball pressed into the bar, which slides freely, slips or sticks, derivatives by materials are exact."""
    command = Command({"ball": Pose((0.0, 0.0, 0.006))}, loads={"push": 2.0})
    overrides = {"obstacles": {"ball": {"sphere": {"radius": 0.03}, "at": [0.07, 0.004, -0.04], "friction": friction}}}
    overrides.update(damped(scheme=scheme))
    name = f"materials.soft.{key}"
    assert motion_error((name, lambda change: (command, {name: value + change}), step, overrides)) <= 1.0


def test_following_changes_no_bit() -> None:
    """Following a parameter leaves positions and velocities unchanged to the last bit."""
    followed, plain = moved(PULL, {}, "materials.soft.young"), moved(PULL, {})
    np.testing.assert_array_equal(followed.positions, plain.positions)
    np.testing.assert_array_equal(followed.result.velocities, plain.result.velocities)


def test_the_jacobian_of_the_last_step() -> None:
    """The Jacobian is with respect to the last step's command only, whatever parameter was followed before."""
    simulation = moved(PULL, {}, "actuators.a")
    exact = simulation.jacobian(["tip"])[0, :, 0]
    tips = []
    for change in (1e-2, -1e-2):
        other = Simulation(simulation.scene)
        for step in range(STEPS):
            other.step(Command(actuators={"a": 0.3 + change * (step == STEPS - 1)}))
        tips.append(other.probe_positions()["tip"])
    difference = (tips[0] - tips[1]) / 2e-2
    np.testing.assert_allclose(exact, difference, rtol=0, atol=NEAR * np.abs(difference).max())


@pytest.mark.parametrize(
    "replaced", [lambda s, there: s.restore(there), lambda s, there: s.reset()], ids=["restore", "reset"]
)
def test_a_replaced_state_ends_the_following(replaced: Callable[[Simulation, Any], None]) -> None:
    """After a restore or reset, derivatives of the abandoned motion are refused until `follow` is called again."""
    simulation = Simulation(scene_from_text(BAR))
    simulation.follow(["loads.weight"])
    simulation.step()
    there = simulation.snapshot()
    simulation.step()
    replaced(simulation, there)
    simulation.step()
    with pytest.raises(GdfeError, match=r"state was replaced after `follow`.*remedy: follow"):
        simulation.sensitivities()
    simulation.follow(["loads.weight"])
    simulation.step()
    assert np.abs(simulation.sensitivities().matrix).max() > 0.0


def test_what_has_no_derivative() -> None:
    """A derivative before the first step, or by a parameter that is not followed, is refused with one clear error."""
    simulation = Simulation(scene_from_text(BAR))
    with pytest.raises(GdfeError, match="no step in motion led here; remedy: step first"):
        simulation.sensitivities()
    simulation.follow(["loads.weight"])
    simulation.step(PULL)
    with pytest.raises(CommandError, match=r"nothing to follow; parameters of this scene: actuators.a"):
        simulation.follow([])
    with pytest.raises(CommandError, match=r"'actuators.a' is not followed; followed: loads.weight"):
        simulation.sensitivities(None, ["actuators.a"])

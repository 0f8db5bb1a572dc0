# SPDX-License-Identifier: Apache-2.0
"""Exact derivatives of equilibria against central differences of equilibria."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.errors import CommandError, GdfeError
from gdfe_ros.scene import load_scene, scene_from_text
from test.written import advance, simulate

NEAR = 1e-4
"""Allowed relative difference between a derivative and a central difference."""
NOISE = 1e-8
"""Relative error of a solved reaction."""
BAR = """
name: bar
mesh: {bar: {size: [0.1, 0.03, 0.03], cells: [8, 3, 3]}}
materials:
  stiff: {law: neo_hookean, young: 2.0e5, poisson: 0.3, density: 1200}
  soft: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1100}
regions: [{material: stiff}, {material: soft, where: {box: {x: [0.03, 0.1]}}}]
handles: {base: {where: {face: x-}}}
loads: {weight: {gravity: [0, 0, -9.81]}, push: {surface: {where: {face: x+}, force: [0, 0.05, 0]}}}
probes: {tip: [0.1, 0, 0], edge: [0.1, 0.015, 0.015]}
solver: {tolerance: 1.0e-10, max_iterations: 100000}
"""
CABLE = "[[0, 0, 0.012], [0.05, 0.003, 0.012], [0.098, 0, 0.012]]"
HOLLOW = {"mesh.bar": {"size": [0.1, 0.03, 0.03], "cells": [10, 3, 3], "cut": [{"box": {"x": [0.02, 0.08],
          "y": [-0.005, 0.005], "z": [-0.005, 0.005]}}]}}  # fmt: skip
ROTATION = (0.1, -0.2, 0.3)


def solved(text: str, command: Command, **overrides: Any) -> Simulation:
    """Return the simulation of a scene after one converged step; overrides have ``__`` for a dot."""
    simulation = simulate(text, **overrides)
    advance(simulation, command)
    return simulation


def seen(simulation: Simulation) -> np.ndarray:
    """Return the probe positions [m] and the base's reaction [N, N m], concatenated to (k,)."""
    probes = [*simulation.probe_positions().values()]
    return np.concatenate([*probes, simulation.result.reactions["base"]])


def worst_error(
    text: str, command: Command, name: str, beside: Any, step: float, near: float = NEAR, **overrides: Any
) -> float:
    """Return the largest error of a derivative against a fourth-order central difference, divided by the allowed error.

    ``beside`` is a function from the parameter's change to the command and scene overrides.
    """
    simulation = solved(text, command, **overrides)
    outputs = [*(f"probes.{probe}" for probe in simulation.scene.probes), "reactions.base"]
    exact = simulation.sensitivities(outputs, [name]).matrix[:, 0]
    values = {}
    for change in (step, -step, 2.0 * step, -2.0 * step):
        other, more = beside(change)
        values[change] = seen(solved(text, other, **{**overrides, **more}))
    near_by, far = ((values[h] - values[-h]) / (2.0 * h) for h in (step, 2.0 * step))
    difference = (4.0 * near_by - far) / 3.0
    weight = NOISE * np.abs(values[step][-6:]).max() / step
    parts = (slice(0, len(difference) - 6), 0.0), (slice(-6, -3), weight), (slice(-3, None), weight)
    return largest_share(exact, difference, near, parts)


def largest_share(
    exact: np.ndarray, difference: np.ndarray, near: float, parts: Iterable[tuple[slice, float]]
) -> float:
    """Return the largest error divided by the allowed one: ``near`` times a part's largest entry, plus its noise."""
    errors = [
        np.abs(exact[part] - difference[part]).max() / (near * np.abs(difference[part]).max() + noise)
        for part, noise in parts
    ]
    return float(np.max(errors))


def cable(command: str) -> str:
    """Return a cable with a mode of command, and further entries."""
    return f"{{cable: {{points: {CABLE}, command: {command}}}}}"


def chamber(command: str) -> str:
    """Return a chamber in the middle of the hollow bar."""
    return f"{{chamber: {{near: [0.05, 0, 0], command: {command}}}}}"


def with_actuator(kind: str) -> str:
    """Return the scene text of the bar with one actuator, ``a``."""
    return f"{BAR}actuators: {{a: {kind}}}\n"


def command_error(kind: str, value: float, step: float, **overrides: Any) -> float:
    """Return `worst_error` of the derivative with respect to the command of the bar's one actuator, at a value."""

    def beside(change: float) -> tuple[Command, dict[str, Any]]:
        return Command(actuators={"a": value + change}), {}

    return worst_error(with_actuator(kind), beside(0.0)[0], "actuators.a", beside, step, **overrides)


GROWTH = "{growth: {stretch: [1.2, 1, 0.95], where: {box: {z: [0, 0.015]}}}}"
RUBBER = {**HOLLOW, "materials__soft__poisson": 0.49}


@pytest.mark.parametrize(
    ("kind", "value", "step", "overrides"),
    [
        pytest.param(cable("tension"), 0.4, 1e-2, {}, id="tension"),
        pytest.param(cable("shortening"), 0.004, 1e-4, {}, id="shortening"),
        pytest.param(cable("shortening, stiffness: 200"), 0.004, 1e-4, {}, id="shortening of an elastic cable"),
        pytest.param(cable("length"), 0.095, 1e-4, {}, id="length"),
        pytest.param(chamber("pressure"), 4000.0, 40.0, RUBBER, id="pressure"),
        pytest.param(chamber("volume"), 6.6e-6, 1e-8, RUBBER, id="volume"),
        pytest.param(GROWTH, 0.5, 1e-2, {}, id="growth"),
    ],
)
def test_commands(kind: str, value: float, step: float, overrides: dict[str, Any]) -> None:
    """Derivatives with respect to the command of each kind of actuator equal central differences."""
    assert command_error(kind, value, step, **overrides) <= 1.0


def test_growth_of_an_incompressible_body() -> None:
    """At nu = 0.5 the base's reaction stays the weight while a part grows: its derivative is zero to 1e-4 of it."""
    text = with_actuator(GROWTH)
    rubber = {"materials__soft__poisson": 0.5, "materials__stiff__poisson": 0.5}
    simulation = solved(text, Command(actuators={"a": 0.3}), **rubber, solver__tolerance=1e-8)
    matrix = simulation.sensitivities(["reactions.base"], ["actuators.a", "materials.soft.young"]).matrix
    weight = np.linalg.norm(simulation.result.reactions["base"][:3])
    assert np.abs(matrix[:3] * [1.0, 1e5]).max() < 1e-4 * weight


def test_loads() -> None:
    """Derivatives with respect to a load factor equal central differences."""

    def pushed(change: float) -> tuple[Command, dict[str, Any]]:
        return Command(loads={"push": 1.0 + change}), {}

    assert worst_error(BAR, Command(), "loads.push", pushed, 1e-2) <= 1.0


TIP = {"free": {"handles__tip": {"where": {"face": "x+"}, "free": ["y"]}},
       "hinge": {"handles__tip": {"where": {"face": "x+"}, "free": ["z", "ry"]}},
       "ball": {"handles__tip": {"where": {"face": "x+"}, "free": ["z", "rx", "ry", "rz"]}}}  # fmt: skip


POSES = [(kind, axis, at) for kind in TIP for axis, at in (("x", 0), ("rx", 3), ("rz", 5)) if kind != "ball" or at < 3]
"""Kind of the tip handle, held axis, and index of the axis in the pose; a command of a free axis has no effect."""


@pytest.mark.parametrize(("kind", "axis", "at"), POSES)
def test_poses(kind: str, axis: str, at: int) -> None:
    """Derivatives with respect to the held axes of a sliding, hinged or ball-jointed handle equal differences."""

    def posed(change: float) -> tuple[Command, dict[str, Any]]:
        parts = np.array([-0.006, 0.004, 0.0, *ROTATION]) + change * np.eye(6)[at]
        return Command(handles={"tip": Pose(tuple(parts[:3]), tuple(parts[3:]))}), {}

    assert worst_error(BAR, posed(0.0)[0], f"handles.tip.{axis}", posed, 5e-5 if at < 3 else 5e-3, **TIP[kind]) <= 1.0


def test_the_base_carries_everything() -> None:
    """Derivatives with respect to the pose of the only handle, under gravity, equal central differences."""
    for axis, at in (("y", 1), ("rx", 3)):

        def posed(change: float, at: int = at) -> tuple[Command, dict[str, Any]]:
            parts = np.array([0.0, 0.0, 0.01, *ROTATION]) + change * np.eye(6)[at]
            return Command(handles={"base": Pose(tuple(parts[:3]), tuple(parts[3:]))}), {}

        simulation = solved(BAR, posed(0.0)[0])
        exact = simulation.sensitivities(None, [f"handles.base.{axis}"]).matrix[:, 0]
        above, below = (seen(solved(BAR, posed(side)[0]))[:6] for side in (1e-3, -1e-3))
        np.testing.assert_allclose(exact, (above - below) / 2e-3, rtol=0, atol=NEAR * np.abs(exact).max())


LAWS: Mapping[str, tuple[dict[str, Any], dict[str, float]]] = {
    "linear": ({"law": "linear", "young": 1e5, "poisson": 0.3, "density": 1100}, {"young": 1e5, "poisson": 0.3}),
    "nearly incompressible": (
        {"law": "neo_hookean", "young": 1e5, "poisson": 0.495, "density": 1100},
        {"young": 1e5, "poisson": 0.495, "density": 1100.0},
    ),
    "stable": (
        {"law": "stable_neo_hookean", "young": 1e5, "poisson": 0.3, "density": 1100},
        {"young": 1e5, "poisson": 0.3, "density": 1100.0},
    ),
    "stable, nearly incompressible": (
        {"law": "stable_neo_hookean", "young": 1e5, "poisson": 0.495, "density": 1100},
        {"young": 1e5, "poisson": 0.495},
    ),
    "incompressible": ({"law": "neo_hookean", "young": 1e5, "poisson": 0.5, "density": 1100}, {"young": 1e5}),
    "ogden": (
        {"law": "ogden", "mu": [2e4, 1.5e4], "alpha": [2.0, -3.0], "poisson": 0.49, "density": 1100},
        {"mu.0": 2e4, "alpha.1": -3.0, "poisson": 0.49},
    ),
    "curve": (
        {"law": "curve", "coefficients": [1e5, -8e4, 4e4], "poisson": 0.48, "density": 1100},
        {"coefficients.0": 1e5, "coefficients.1": -8e4, "poisson": 0.48},
    ),
    "yeoh": (
        {"law": "yeoh", "c10": 1.1e4, "c20": 2e3, "c30": 30.0, "poisson": 0.45, "density": 1100},
        {"c10": 1.1e4, "c20": 2e3, "c30": 30.0},
    ),
    "mooney and rivlin": (
        {"law": "mooney_rivlin", "c10": 1.4e4, "c01": 6e3, "poisson": 0.45, "density": 1100},
        {"c10": 1.4e4, "c01": 6e3},
    ),
    "arruda and boyce": (
        {"law": "arruda_boyce", "mu": 3e4, "lambda_m": 2.8, "poisson": 0.45, "density": 1100},
        {"mu": 3e4, "lambda_m": 2.8},
    ),
    "gent": (
        {"law": "gent", "mu": 31.7e3, "jm": 39.6, "poisson": 0.45, "density": 1100},
        {"mu": 31.7e3, "jm": 39.6},
    ),
}  # fmt: skip


@pytest.mark.parametrize("law", LAWS)
def test_materials(law: str) -> None:
    """Derivatives with respect to each law's parameters equal differences, for a stretched, twisted, heavy bar."""
    material, varied = LAWS[law]
    tip, command = {"where": {"face": "x+"}, "free": ["z"]}, Command(
        handles={"tip": Pose((0.02, 0.0, 0.0), (0.6, 0.0, 0.0))}
    )  # fmt: skip
    made = {"materials__soft": material, "handles__tip": tip}
    for key, value in varied.items():
        # Of Poisson's ratio by more: near 0.5 it moves the body so little that a smaller difference is rounding.
        step = 5e-2 * min(0.5 - value, 0.1) if key == "poisson" else 1e-2 * abs(value)

        def beside(change: float, key: str = key, value: float = value) -> tuple[Command, dict[str, Any]]:
            name, _, index = key.partition(".")
            if index:
                values = list(material[name])
                values[int(index)] = value + change
                return command, {"materials__soft": {**material, name: values}}
            return command, {"materials__soft": {**material, key: value + change}}

        assert worst_error(BAR, command, f"materials.soft.{key}", beside, step, **made) <= 1.0


BALL = {"obstacles__ball": {"sphere": {"radius": 0.03}, "at": [0.07, 0.004, -0.040]}}


def test_contact_with_a_ball() -> None:
    """With a pressed ball, derivatives by weight, the ball's position and a modulus equal central differences."""
    raised = {"ball": Pose((0.0, 0.0, 0.004))}
    cases = {
        "loads.weight": (lambda change: (Command(raised, loads={"weight": 1.0 + change}), {}), 1e-2),
        "obstacles.ball.z": (lambda change: (Command({"ball": Pose((0.0, 0.0, 0.004 + change))}), {}), 2e-5),
        "materials.soft.young": (lambda change: (Command(raised), {"materials__soft__young": 1e5 + change}), 500.0),
    }
    for name, (beside, step) in cases.items():
        assert worst_error(BAR, Command(raised), name, beside, step, **BALL) <= 1.0, name


def test_slack_cables_pull_when_they_are_told_to() -> None:
    """For a slack cable in the undeformed state, the derivative by its tension equals the one-sided difference."""
    text, step = with_actuator(cable("tension")), 1e-3
    here = solved(text, Command())
    exact = here.sensitivities(["probes.tip"], ["actuators.a"]).matrix[:, 0]
    tips = [solved(text, Command(actuators={"a": pull})).probe_positions()["tip"] for pull in (step, 2.0 * step)]
    began = here.probe_positions()["tip"]
    difference = (4.0 * tips[0] - 3.0 * began - tips[1]) / (2.0 * step)
    np.testing.assert_allclose(exact, difference, rtol=0, atol=NEAR * np.abs(difference).max())


def test_states_without_derivatives() -> None:
    """A derivative of a state that has not converged, or with an unknown name, is refused with one clear error."""
    simulation = Simulation(scene_from_text(BAR, overrides={"solver.max_iterations": 3}))
    simulation.step()
    with pytest.raises(GdfeError, match="no derivative: the state is no equilibrium"):
        simulation.sensitivities(None, ["loads.push"])
    with pytest.raises(CommandError, match=r"no parameter 'loads.pull' in this scene; parameters: loads.weight"):
        simulation.sensitivities(None, ["loads.pull"])
    with pytest.raises(CommandError, match=r"no output 'tip' in this scene; outputs: probes.tip, probes.edge"):
        simulation.sensitivities(["tip"], ["loads.push"])


def test_there_is_no_derivative_before_the_first_step() -> None:
    """With gravity, the undeformed state is no equilibrium, and derivatives are refused until a step has been made."""
    simulation = Simulation(load_scene("tendon_finger"))
    for _ in range(2):
        with pytest.raises(GdfeError, match="not solved yet; remedy: step first"):
            simulation.sensitivities()
        simulation.step()
        assert simulation.sensitivities().matrix.shape == (3, 2)
        with pytest.raises(CommandError, match="no parameter was named"):
            _ = simulation.sensitivities(None, []).matrix
        there = simulation.snapshot()
        simulation.restore(there)
        assert simulation.sensitivities().matrix.shape == (3, 2)
        simulation.reset()

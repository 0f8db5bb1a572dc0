# SPDX-License-Identifier: Apache-2.0
"""States without a two-sided derivative, and cables that cannot be shortened: correct values or errors."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.errors import GdfeError
from test.written import scene_of

BASE = "base: {where: {face: x-}, fixed: true}"
HINGE = f"{BASE}, tip: {{where: {{face: x+}}, free: [x, z, ry]}}"
INSIDE = "pull: {{cable: {{points: [[0.02, 0, 0.008], [0.08, 0, 0.008]], command: {mode}}}}}"
HANDLE = "pull: {{cable: {{points: [[0, -0.005, 0.008], [0, 0.005, 0.008]], command: {mode}}}}}"
ACROSS = "pull: {{cable: {{points: [[0, 0, 0.008], [0.1, 0, 0.008]], command: {mode}}}}}"
BALL = """\
mesh: {sphere: {inner: 0.010, outer: 0.015, cells: [2, 1]}}
materials: {rubber: {law: neo_hookean, young: 1.0e6, poisson: 0.45}}
handles: {base: {where: {box: {x: [-1, -0.0101]}}, fixed: true}}
actuators: {air: {chamber: {command: pressure}}}
probes: {side: [0.0149, 0, 0]}
"""
STABLE = 1e5
"""Pressure [Pa] at which the ball is far from its loss of stability."""


def slopes(lab: Any, simulation: Simulation, probe: str, name: str, value: float, change: float) -> np.ndarray:
    """Return the second-order one-sided difference (3,) of a probe with respect to a command, by fresh simulations."""
    values = (value, value + change, value + 2.0 * change)
    ends = [lab.fresh(simulation, Command(actuators={name: item})).probe_positions()[probe] for item in values]
    return (4.0 * ends[1] - 3.0 * ends[0] - ends[2]) / (2.0 * change)


def jacobian_or_error(simulation: Simulation, probe: str, name: str) -> np.ndarray | None:
    """Return a column of the Jacobian; None if it is refused with an error or NaN."""
    try:
        column = simulation.jacobian([probe], [name])[0, :, 0]
    except GdfeError as error:
        assert name in str(error)  # noqa: PT017 - either answer is sound
        return None
    return None if np.isnan(column).any() else column


# --- a cable that is just slack, or just taut ---


@pytest.mark.parametrize("detour", [0.0, 0.001, 0.003])
@pytest.mark.parametrize("handles", [BASE, HINGE], ids=["fixed", "hinge"])
@pytest.mark.parametrize("mode", ["shortening", "length"])
def test_jacobian_at_the_rest_length(lab: Any, mode: str, handles: str, detour: float) -> None:
    """At a cable's undeformed length, the Jacobian is the derivative on the taut side within 5 %, or an error."""
    simulation = lab.bar(handles=handles, actuators=INSIDE.format(mode=mode))
    rest, taut = (0.0, 1.0) if mode == "shortening" else (0.06, -1.0)
    if detour:
        lab.go(simulation, pull=rest + taut * detour)
    assert lab.go(simulation, pull=rest).converged
    found = jacobian_or_error(simulation, "tip", "pull")
    if found is not None:
        expected = slopes(lab, simulation, "tip", "pull", rest, taut * 1e-4)
        np.testing.assert_allclose(found, expected, atol=0.05 * np.abs(expected).max())


# --- a ball beside the pressure at which it loses its stability ---


class Filled:
    """The ball with commanded volume, which passes the maximum of pressure smoothly.

    Args:
        lab: maker of a fresh simulation.
    """

    def __init__(self, lab: Any) -> None:
        scene = scene_of(BALL, overrides={"actuators.air.chamber.command": "volume"})
        self._simulation = lab.fresh(Simulation(scene))
        self.rest = self._simulation.actuator_states()["air"].extent
        found = minimize_scalar(lambda ratio: -self.at(ratio)[0], bounds=(2.0, 8.0), options={"xatol": 1e-4})
        self.ratio, self.pressure = found.x, -found.fun

    def at(self, ratio: float) -> tuple[float, float]:
        """Return pressure [Pa] and the probe's x [m] at a volume of ``ratio`` times the undeformed one."""
        self._simulation.reset()
        state = self._simulation.step(Command(actuators={"air": ratio * self.rest})).actuators["air"]
        return state.effort, self._simulation.probe_positions()["side"][0]

    def slope(self, pressure: float) -> float:
        """Return d(probe)/d(pressure) [m/Pa] on the stable side of the maximum."""
        ratio = brentq(lambda value: self.at(value)[0] - pressure, 1.01, self.ratio, xtol=1e-7)
        (low, first), (high, second) = (self.at(ratio + way) for way in (-2e-4, 2e-4))
        return (second - first) / (high - low)


@pytest.fixture(scope="module")
def filled(lab: Any) -> Filled:
    """Return the ball with commanded volume."""
    return Filled(lab)


def blown(pressure: float) -> Simulation:
    """Return the ball at a commanded pressure."""
    simulation = Simulation(scene_of(BALL))
    for command in (STABLE, pressure):
        simulation.step(Command(actuators={"air": command}))
    return simulation


@pytest.mark.parametrize("below", [10.0, 20.0, 100.0, 1000.0, 10_000.0])
def test_jacobian_beside_the_loss_of_stability(filled: Filled, below: float) -> None:
    """Below the limit pressure, the Jacobian is the slope found by commanded volume within 5 %, or an error."""
    simulation = blown(filled.pressure - below)
    assert simulation.result.converged
    found = jacobian_or_error(simulation, "side", "air")
    assert found is None or found[0] == pytest.approx(filled.slope(filled.pressure - below), rel=0.05)


@pytest.mark.parametrize("below", [0.01, 0.1, 1.0, 5.0])
def test_jacobian_at_the_limit_is_not_small(filled: Filled, below: float) -> None:
    """Close below the limit pressure, the Jacobian is larger than at 20 Pa below it, or an error, never a silent 0."""
    simulation = blown(filled.pressure - below)
    assert simulation.result.converged or "stability" in simulation.result.message
    found = jacobian_or_error(simulation, "side", "air")
    assert found is None or found[0] > filled.slope(filled.pressure - 20.0)


# --- cables that hold on to handles ---


@pytest.mark.exact("an exact zero without a shift")
@pytest.mark.parametrize("mode", ["tension", "shortening", "length"])
def test_a_cable_inside_a_fixed_handle_is_refused_or_reads_sense(lab: Any, mode: str) -> None:
    """A cable inside a fixed handle is refused by name, or its tension is limited and the step ends soon."""
    try:
        simulation = lab.bar(actuators=HANDLE.format(mode=mode))
        command = {"tension": 1.0, "shortening": 0.001, "length": 0.005}[mode]
        result = lab.go(simulation, pull=command)
    except GdfeError as error:
        assert "pull" in str(error)  # noqa: PT017 - either answer is sound
        return
    assert abs(result.actuators["pull"].effort) < 1e4
    assert result.substeps < 20
    assert np.array_equal(result.positions, simulation.mesh.vertices)
    assert result.converged == (mode == "tension")


@pytest.mark.parametrize("mode", ["shortening", "length"])
def test_a_straight_cable_between_two_handles_draws_them_together(lab: Any, mode: str) -> None:
    """A cable shortened by 1 mm moves the sliding handle by 1 mm, at the tension that the body needs."""
    simulation = lab.bar(handles=f"{BASE}, tip: {{where: {{face: x+}}, free: [x]}}", actuators=ACROSS.format(mode=mode))
    result = lab.go(simulation, pull=0.001 if mode == "shortening" else 0.099)
    assert result.converged, result.message
    assert simulation.handle_pose("tip").translation[0] == pytest.approx(-0.001, abs=2e-5)
    twin = lab.bar(handles=f"{BASE}, tip: {{where: {{face: x+}}}}", actuators="")
    push = lab.go(twin, simulation.handle_pose("tip")).reactions["tip"][0]
    assert result.actuators["pull"].effort == pytest.approx(-push, rel=0.02)


@pytest.mark.exact("it compares with the vertices of the mesh to the bit")
@pytest.mark.parametrize("mode", ["shortening", "length"])
def test_a_cable_shorter_than_its_handles_are_apart_is_named(lab: Any, mode: str) -> None:
    """A cable commanded to 90 mm between handles 100 mm apart is named, and nothing moves; nearer handles converge."""
    points = "[[0, 0, 0.008], [0.05, 0, 0.009], [0.1, 0, 0.008]]"
    cable = f"pull: {{cable: {{points: {points}, command: {mode}}}}}"
    simulation = lab.bar(handles=f"{BASE}, tip: {{where: {{face: x+}}}}", actuators=cable)
    length = simulation.actuator_states()["pull"].extent
    result = lab.go(simulation, pull=0.09 if mode == "length" else length - 0.09)
    assert not result.converged
    assert np.array_equal(result.positions, simulation.mesh.vertices)
    for words in ("'pull'", "a length of 0.09 m", "0.1 m apart", "remedy: command at least that"):
        assert words in result.message
    assert lab.go(simulation, Pose(translation=(-0.02, 0.0, 0.0))).converged

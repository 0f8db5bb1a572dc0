# SPDX-License-Identifier: Apache-2.0
"""Steps that are cut short: each call makes progress, continues the last one, and has a true error estimate."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.results.step_result import StepResult
from test.written import advance, scene_of

BALL = """\
mesh: {sphere: {inner: 0.020, outer: 0.030, cells: [4, 2]}}
materials: {rubber: {law: neo_hookean, young: 1.0e5, poisson: 0.45}}
handles: {base: {where: {box: {x: [-1, -0.025]}}, fixed: true}}
actuators: {air: {chamber: {command: pressure}}}
"""
LOOSE = "base: {where: {face: x-}, fixed: true}, tip: {where: {face: x+}, free: [x, y, z, rx, ry, rz]}"
WEIGHT = "loads: {weight: {gravity: [0, 0, -9.81]}}"
CUTS = [{"cut_after": 0}, {"cut_after": 1}, {"cut_after": 5}, {"deadline": 0.0}, {"deadline": 5e-4}, {"deadline": 6e-3}]
ROUND = 3
"""Allowed ratio of all calls' iterations to those of one uncut step; each call makes at least one."""


def bend5() -> tuple[Simulation, Command]:
    """Return the bar of five segments, and its tip lifted by 0.2 m."""
    return Simulation(load_scene("bend5")), Command(handles={"tip": Pose((0.0, 0.0, 0.2))})


def ball() -> tuple[Simulation, Command]:
    """Return a hollow ball, and a pressure that doubles its volume."""
    return Simulation(scene_of(BALL)), Command(actuators={"air": 15e3})


def drive(simulation: Simulation, command: Command, most: int, **cut: float) -> list[StepResult]:
    """Repeat a command until its step converges, at most ``most`` times; return the results."""
    results: list[StepResult] = []
    while len(results) < most and not (results and results[-1].converged):
        results.append(simulation.step(command, **cut))
    return results


def assert_arrives(results: list[StepResult], exact: StepResult, off: Callable[[StepResult], float]) -> None:
    """Require progress in each call, no message about stability, and the equilibrium at the end."""
    assert not [result.message for result in results if "stability" in result.message]
    assert all(result.iterations > 0 for result in results if not result.converged)
    assert results[-1].converged, f"after {len(results)} calls {off(results[-1]):.2g} of the size off"
    assert sum(result.iterations for result in results) <= ROUND * exact.iterations
    assert off(results[-1]) < 20.0 * 1e-4


@pytest.mark.parametrize("make", [bend5, ball])
@pytest.mark.parametrize("cut", CUTS, ids=str)
def test_a_cut_step_arrives(lab: Any, make: Callable, cut: dict[str, float]) -> None:
    """A step cut anywhere, even before its first iteration, arrives after at most three times the uncut iterations."""
    simulation, command = make()
    exact = Simulation(simulation.scene).step(command)
    results = drive(simulation, command, ROUND * exact.iterations, **cut)
    assert_arrives(results, exact, lambda result: lab.distance(result.positions, exact.positions, simulation.mesh))


@pytest.mark.parametrize("cut", CUTS, ids=str)
def test_a_cut_step_of_free_rotations_arrives(lab: Any, cut: dict[str, float]) -> None:
    """A body on a handle with six free axes, with every step cut, arrives at the equilibrium of an uncut step."""
    simulation = lab.bar(handles=LOOSE, actuators="", more=WEIGHT)
    exact = advance(Simulation(simulation.scene))
    results = drive(simulation, Command(), ROUND * exact.iterations, **cut)
    assert_arrives(results, exact, lambda result: lab.distance(result.positions, exact.positions, simulation.mesh))


@pytest.mark.parametrize("most", [2, 5])
def test_few_iterations_inflate_a_ball_in_the_end(lab: Any, most: int) -> None:
    """With fewer iterations per step than the pressure needs, a ball is not called unstable and arrives in the end."""
    simulation, command = ball()
    exact = simulation.step(command)
    slow = Simulation(scene_of(BALL, overrides={"solver.max_iterations": most}))
    results = drive(slow, command, ROUND * exact.iterations)
    assert all(result.iterations <= most for result in results)
    assert f"{most} iterations" in results[0].message
    assert_arrives(results, exact, lambda result: lab.distance(result.positions, exact.positions, slow.mesh))


@pytest.mark.parametrize("cut", [0, 1, 2, 5, 10, 20])
@pytest.mark.parametrize("name", ["bend5", "ball", "loose"])
def test_the_error_estimate_of_a_cut_step_is_true(lab: Any, name: str, cut: int) -> None:
    """The error estimate of a cut step is at least a third of the distance to the equilibrium."""
    loose = {"handles": LOOSE, "actuators": "", "more": WEIGHT}
    simulation, command = {"bend5": bend5, "ball": ball, "loose": lambda: (lab.bar(**loose), Command())}[name]()
    exact = lab.fresh(simulation, command, tolerance=1e-6)
    for _ in range(3):
        result = simulation.step(command, cut_after=cut)
        off = lab.distance(result.positions, exact.positions, simulation.mesh)
        assert result.error_estimate >= off / 3.0 or off <= simulation.settings.tolerance
        assert result.converged == (result.message == "")


@pytest.mark.parametrize("make", [bend5, ball])
def test_a_cut_step_is_repeated_to_the_bit(make: Callable) -> None:
    """Steps cut by the clock are repeated to the last bit with their recorded ``cut_after``."""
    simulation, command = make()
    twin = Simulation(simulation.scene)
    for result in drive(simulation, command, 40, deadline=2e-3):
        again = twin.step(command, cut_after=result.cut_after)
        assert (again.positions == result.positions).all()
        assert (again.error_estimate, again.energy, again.message) == (
            result.error_estimate,
            result.energy,
            result.message,
        )


def test_a_chamber_that_is_unstable_is_still_named() -> None:
    """With cut steps and a pressure without an equilibrium, the unstable chamber is named at a finite state."""
    simulation, _ = ball()
    results = drive(simulation, Command(actuators={"air": 60e3}), 120, cut_after=20)
    assert not any(result.converged for result in results)
    assert any("'air' lost its stability" in result.message for result in results)

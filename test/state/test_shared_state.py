# SPDX-License-Identifier: Apache-2.0
"""A simulation owns its state: growth, saved states, deferred fields and results do not affect each other."""

from __future__ import annotations

from dataclasses import fields as names_of
from typing import Any

import numpy as np
import pytest

from gdfe_ros import Command, Simulation
from gdfe_ros.checkpoint import load_state, save_state
from gdfe_ros.errors import CommandError


def equal(one: Any, other: Any) -> bool:
    """Return whether two results have the same positions and numbers to the last bit."""
    numbers = ("converged", "iterations", "error_estimate", "energy", "min_det", "message")
    return np.array_equal(one.positions, other.positions) and all(
        getattr(one, name) == getattr(other, name) for name in numbers
    )


# --- saved states ---


def test_a_grown_state_goes_on_elsewhere_to_the_bit(lab: Any) -> None:
    """A saved grown bar, loaded into a simulation that never grew, continues with the same bits."""
    first, second = lab.bar(), lab.bar()
    lab.go(first, heat=0.6)
    load_state(second, save_state(first))
    for _ in range(2):
        assert equal(lab.go(second, pull=0.5), lab.go(first, pull=0.5))
    for name in names_of(first.fields()):
        np.testing.assert_array_equal(getattr(second.fields(), name.name), getattr(first.fields(), name.name))
    assert second.actuator_states() == first.actuator_states()


@pytest.mark.exact("it compares with the vertices of the mesh to the bit")
@pytest.mark.parametrize("poisson", [0.3, 0.499, 0.5])
def test_a_saved_rest_is_rest_after_growth(lab: Any, poisson: float) -> None:
    """An undeformed state, loaded into a grown simulation, continues as if it had never grown, also after a reset."""
    how = {"materials__rubber__poisson": poisson}
    grown, plain = lab.bar(**how), lab.bar(**how)
    rest = save_state(lab.bar(**how))
    lab.go(grown, heat=1.0)
    load_state(grown, rest)
    assert np.array_equal(grown.positions, grown.mesh.vertices)
    assert equal(lab.go(grown, pull=0.05), lab.go(plain, pull=0.05))
    grown.reset()
    plain.reset()
    assert equal(lab.go(grown, heat=0.2), lab.go(plain, heat=0.2))


def test_loading_a_state_leaves_the_one_it_came_from_alone(lab: Any) -> None:
    """One state loaded into two simulations is not shared: each continues as if alone."""
    scene = lab.scene()
    source = Simulation(scene)
    lab.go(source, heat=0.6)
    state = save_state(source)
    one, other = Simulation(scene), Simulation(scene)
    load_state(one, state)
    load_state(other, state)
    lab.go(one, heat=0.0)
    assert equal(lab.go(other, pull=0.3), lab.go(source, pull=0.3))


def test_a_watched_simulation_can_be_saved(lab: Any) -> None:
    """A simulation with an energy observer can be saved; its copy has the same next step and no observer."""
    first, second, seen = lab.bar(), lab.bar(), []
    first.observe_energy(lambda *values: seen.append(values))
    lab.go(first, pull=0.3)
    load_state(second, save_state(first))
    count = len(seen)
    assert count > 0
    after = lab.go(second, pull=0.4)
    assert len(seen) == count
    assert equal(lab.go(first, pull=0.4), after)
    assert len(seen) > count


# --- a start from given positions, and a restart from rest ---


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_restart_with_growth_starts_from_rest(lab: Any, axis: int) -> None:
    """From mirrored positions, a growing body reaches a fresh simulation's equilibria, and its bits after a reset."""
    how = {"materials__rubber__poisson": 0.499}
    mirrored, plain = lab.bar(**how), lab.bar(**how)
    lab.go(mirrored, heat=0.8)
    positions = mirrored.mesh.vertices.copy()
    positions[:, axis] *= -1.0
    mirrored.set_positions(positions)
    for heat in (0.3, 0.4, 0.0):
        found, expected = lab.go(mirrored, heat=heat), lab.go(plain, heat=heat)
        assert found.converged
        assert found.energy == pytest.approx(expected.energy, rel=0.01, abs=1e-6)
        assert lab.distance(found.positions, expected.positions, plain.mesh) < 1e-3
    mirrored.reset()
    plain.reset()
    assert equal(lab.go(mirrored, heat=0.4), lab.go(plain, heat=0.4))


# --- jacobians ---


@pytest.mark.parametrize("poisson", [0.3, 0.45, 0.499, 0.5])
def test_jacobian_with_growth_equals_differences(lab: Any, poisson: float) -> None:
    """d(tip)/d(heat) and d(tip)/d(pull) of a grown and pulled bar equal differences of fresh simulations."""
    simulation = lab.bar(materials__rubber__poisson=poisson)
    at = {"heat": 0.5, "pull": 0.2}
    lab.go(simulation, **at)
    jacobian = simulation.jacobian(["tip"], ["heat", "pull"])[0]
    for column, (name, change) in enumerate({"heat": 1e-3, "pull": 1e-3}.items()):
        ends = [lab.fresh(simulation, Command(actuators={**at, name: at[name] + way * change})) for way in (-1, 1)]
        low, high = (end.probe_positions()["tip"] for end in ends)
        slope = (high - low) / (2.0 * change)
        np.testing.assert_allclose(jacobian[:, column], slope, atol=5e-3 * np.abs(slope).max(), err_msg=name)


@pytest.mark.parametrize("poisson", [0.3, 0.45, 0.499])
def test_relative_jacobian_equals_differences(lab: Any, poisson: float) -> None:
    """With the policy ``relative``, d(tip)/d(heat) equals a difference over the same load path within 2 %."""
    scene = lab.scene(
        actuators="heat: {growth: {stretch: [0.9, 1, 1], where: {box: {z: [0, 1]}}}}",
        more="solver: {policy: relative, tolerance: 1.0e-8}",
        materials__rubber__poisson=poisson,
    )
    simulation, start = Simulation(scene), Command(actuators={"heat": 0.5})
    simulation.step(start)
    jacobian = simulation.jacobian(["tip"], ["heat"])[0, :, 0]
    ends = [lab.fresh(simulation, start, Command(actuators={"heat": heat})) for heat in (0.49, 0.51)]
    slope = (ends[1].probe_positions()["tip"] - ends[0].probe_positions()["tip"]) / 0.02
    np.testing.assert_allclose(jacobian, slope, atol=0.02 * np.abs(slope).max())


@pytest.mark.parametrize("way", [(0.1, 0.0), (1.0, 0.0), (0.3, 0.6, 1.0, 0.5, 0.0)])
def test_relative_with_growth_comes_home(lab: Any, way: tuple[float, ...]) -> None:
    """With the policy ``relative``, a body that grows and shrinks returns within ten tolerances."""
    simulation = lab.bar(actuators="heat: {growth: {stretch: [0.9, 1, 1], where: {box: {z: [0, 1]}}}}",
                         more="solver: {policy: relative}")  # fmt: skip
    for heat in way:
        result = lab.go(simulation, heat=heat)
        assert result.converged
    off = lab.distance(result.positions, simulation.mesh.vertices, simulation.mesh)
    assert off <= 10.0 * simulation.settings.tolerance


# --- fields and results of the past ---


@pytest.mark.parametrize("policy", ["energy", "relative"])
def test_deferred_fields_are_those_of_their_time(lab: Any, policy: str) -> None:
    """Fields taken from a grown state have the same bits when evaluated after two further steps."""
    simulation = lab.bar(actuators="heat: {growth: {stretch: [0.9, 1, 1], where: {box: {z: [0, 1]}}}}",
                         more=f"solver: {{policy: {policy}}}")  # fmt: skip
    lab.go(simulation, heat=0.5)
    later, now = simulation.later_fields(), simulation.fields()
    lab.go(simulation, heat=1.0)
    lab.go(simulation, heat=0.0)
    found = later()
    for item in names_of(now):
        np.testing.assert_array_equal(getattr(found, item.name), getattr(now, item.name), err_msg=item.name)


def test_results_and_positions_cannot_change_the_simulation(lab: Any) -> None:
    """Writing into a result or into the positions is refused, or has no effect on the state and the next step."""
    simulation, plain = lab.bar(), lab.bar()
    for each in (simulation, plain):
        lab.go(each, pull=0.3)
    for array in (simulation.result.positions, simulation.positions, simulation.result.reactions["base"]):
        try:
            array += 1.0
        except ValueError as error:
            assert "read-only" in str(error)  # noqa: PT017 - either answer is sound
    assert np.array_equal(simulation.positions, plain.positions)
    assert equal(lab.go(simulation, pull=0.4), lab.go(plain, pull=0.4))


@pytest.mark.parametrize("dt", [-1.0, -1e-9, float("nan"), float("inf")])
def test_time_that_runs_backwards_is_refused(lab: Any, dt: float) -> None:
    """A step with an invalid dt and a rate limit raises an error that names dt, and changes nothing."""
    how = {"actuators__pull__cable__rate": 1.0}
    simulation, plain = lab.bar(**how), lab.bar(**how)
    for each in (simulation, plain):
        each.step(Command(actuators={"pull": 0.1}), dt=0.1)
    with pytest.raises(CommandError, match="dt"):
        simulation.step(Command(actuators={"pull": 0.5}), dt=dt)
    assert (simulation.time, simulation.commands) == (plain.time, plain.commands)
    assert simulation.actuator_states() == plain.actuator_states()
    results = [each.step(Command(actuators={"pull": 0.2}), dt=0.1) for each in (simulation, plain)]
    assert equal(*results)

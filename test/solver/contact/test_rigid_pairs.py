# SPDX-License-Identifier: Apache-2.0
"""Contact between rigid bodies, and with other things at the same time."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.constraints.form import Box, Cylinder
from gdfe_ros.results.contacts import contact_names
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.solver.contact import complementarity
from gdfe_ros.solver.motion import impulse, inertia
from gdfe_ros.solver.state import replace_fields
from test.written import advance, scene_of

FLOORED = {
    "obstacles": {"floor": {"plane": [0, 0, 1], "at": [0, 0, -0.1], "fixed": True, "friction": 0.5}},
    "loads": {"weight": {"gravity": [0, 0, -9.81]}},
}
"""A floor, and gravity."""
PAIR = """
mesh: {bar: {size: [0.05, 0.05, 0.05], cells: [2, 2, 2]}}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.4, density: 1000}}
handles: {base: {where: {face: x-}, fixed: true}}
bodies:
  one: {box: {size: [0.04, 0.04, 0.04]}, density: 800, at: [0.1, 0, 0], friction: 0.3}
  two: {box: {size: [0.04, 0.03, 0.05]}, density: 1200, at: [0.17, 0, 0], friction: 0.3}
dynamics: {scheme: bdf2, step: 0.002}
solver: {tolerance: 1.0e-5}
"""
STACKED = {
    "bodies.one.at": [0.1, 0, -0.0799],
    "bodies.two": {"box": {"size": [0.04, 0.04, 0.04]}, "density": 800, "at": [0.1, 0, -0.0398], "friction": 0.5},
    "dynamics.step": 0.005,
    "dynamics.damping": {"viscosity": 500},
    "solver.tolerance": 1e-6,
}
Vector = tuple[float, float, float]


@pytest.fixture
def pair() -> Callable[..., Simulation]:
    """Give a function that makes two rigid boxes beside a soft one; it takes overrides of scene keys."""

    def make(**overrides: Any) -> Simulation:
        given = overrides.pop("more", {})
        return Simulation(scene_of(PAIR, overrides={**given, **overrides}))

    return make


def kick(simulation: Simulation, **speeds: tuple[Vector, Vector]) -> None:
    """Make one step, then give bodies a velocity [m/s] and an angular velocity [rad/s]."""
    simulation.step()
    state, h = simulation.state, simulation.scene.dynamics.step
    saved = {name: array.copy() for name, array in state.terms[inertia.NAME].items()}
    for body in simulation.stepper.body.handles:
        if body.name in speeds:
            x, (velocity, spin) = state.positions[body.vertices], speeds[body.name]
            moving = velocity + np.cross(spin, x - x.mean(axis=0))
            saved["velocity"][body.vertices] = saved["velocity_before"][body.vertices] = moving
            saved["before"][body.vertices] = x - h * moving
    ledger = replace_fields(state.ledger, bound=None)  # what it is given here is in no account
    simulation.state = state.with_(terms={**state.terms, inertia.NAME: saved}, ledger=ledger)


def momenta(simulation: Simulation) -> tuple[np.ndarray, np.ndarray]:
    """Return the two bodies' momentum [kg m/s], and angular momentum [kg m^2/s] about the point midway between them."""
    own = simulation.state.positions[-8:] + simulation.origin - [0.135, 0.0, 0.0]
    each = (simulation.stepper.mass @ simulation.stepper.velocities(simulation.state))[-8:]
    return each.sum(axis=0), np.cross(own, each).sum(axis=0)


def test_momentum_is_kept_where_boxes_collide(pair: Callable[..., Simulation]) -> None:
    """A spinning box hits another face to face: momenta stay to 1e-6, friction slows both spins, energy never grows."""
    exact = {"dynamics.step": 0.0005, "solver.tolerance": 1e-6}
    simulation = pair(more={**exact, "bodies.two.at": [0.15, 0, 0]})
    kick(simulation, one=((0.5, 0.0, 0.0), (1.0, 0.0, 0.0)), two=((0.0, 0.0, 0.0), (-0.2, 0.0, 0.0)))
    start, energies = momenta(simulation), [math.inf]
    for _ in range(120):
        result = advance(simulation)
        assert result.energies["kinetic"] <= energies[-1] * (1.0 + 1e-6)
        energies.append(result.energies["kinetic"])
        for now, before in zip(momenta(simulation), start, strict=True):
            np.testing.assert_allclose(now, before, atol=1e-6 * np.abs(before).max())
    assert energies[-1] < 0.7 * energies[1]
    assert simulation.handle_pose("two").translation[0] > 0.005
    spins = [simulation.handle_pose(name).rotation[0] for name in ("one", "two")]
    advance(simulation)
    after = [simulation.handle_pose(name).rotation[0] for name in ("one", "two")]
    assert after[0] - spins[0] < 0.9 * 1.0 * 0.0005
    assert after[1] - spins[1] > -0.9 * 0.2 * 0.0005


def mean_errors(strike: Callable[[float, float], float], *, largest: float) -> list[float]:
    """Return mean errors of five starts, for two steps; ``strike`` takes the step [s] and a shift of the start [m].

    The error of angular momentum depends on the moment within a step at which the bodies meet. Its mean over five
    starts shows the order.
    """
    errors = [[strike(h, shift) for shift in (0.0, 0.0002, 0.0004, 0.0006, 0.0008)] for h in (0.002, 0.0005)]
    assert np.max(errors) < largest
    return np.mean(errors, axis=1).tolist()


@pytest.mark.parametrize("scheme", ["bdf2", "generalised_alpha"])
def test_an_oblique_collision_keeps_what_it_must(pair: Callable[..., Simulation], scheme: str) -> None:
    """Corner on corner, momentum stays to 1e-6, angular momentum to the order of the step, and energy never grows."""

    def collide(h: float, shift: float) -> float:
        place = {"bodies.two.at": [0.17 + shift, 0.015, 0.01]}
        simulation = pair(more={**place, "dynamics.scheme": scheme, "dynamics.step": h})
        kick(simulation, one=((0.5, 0.0, 0.0), (0.0, 0.0, 0.0)))
        return turned_by(simulation, h, lambda result: result.error_estimate < 1e-8)

    first, second = mean_errors(collide, largest=0.01)
    assert second < 0.6 * first


def turned_by(simulation: Simulation, h: float, settled: Callable[[StepResult], bool]) -> float:
    """Return the relative error of angular momentum after 0.1 s in which the first body hits the second one."""
    start, last = momenta(simulation), math.inf
    for _ in range(round(0.1 / h)):
        result = simulation.step()
        assert settled(result), result.message
        assert result.energies["kinetic"] < last * (1.0 + 1e-4)
        last = result.energies["kinetic"]
    now = momenta(simulation)
    np.testing.assert_allclose(now[0], start[0], atol=1e-6 * np.abs(start[0]).max())
    assert simulation.handle_pose("two").translation[0] > 0.005
    return float(np.abs(now[1] - start[1]).max() / (0.02 * np.abs(start[0]).max()))


@pytest.mark.parametrize(
    ("other", "shape"),
    [("sphere", {"radius": 0.02}), ("capsule", {"radius": 0.02, "length": 0.03}), ("box", {"size": [0.04] * 3})],
)
def test_a_ball_that_hits_another_body_keeps_momenta(
    pair: Callable[..., Simulation], other: str, shape: dict[str, Any]
) -> None:
    """An eccentric hit of a ball keeps momentum to 1e-6, angular momentum to the step's order; energy never grows."""

    def strike(h: float, shift: float) -> float:
        two = {other: shape, "density": 1200, "at": [0.16, 0.012, 0.006], "friction": 0.3}
        one = {"sphere": {"radius": 0.02}, "density": 800, "at": [0.1 - shift, 0.0, 0.0], "friction": 0.3}
        simulation = pair(more={"bodies.one": one, "bodies.two": two, "dynamics.step": h})
        kick(simulation, one=((0.5, 0.0, 0.0), (0.0, 0.0, 5.0)))
        error = turned_by(simulation, h, lambda result: result.converged)
        assert list(simulation.result.contacts) == contact_names(simulation.scene.handles)
        return error

    first, second = mean_errors(strike, largest=0.02)
    assert second < 0.6 * first


@pytest.mark.parametrize("aside", [0.0, 0.006, 0.012])
def test_a_fast_ball_does_not_pass_a_rod_beside_its_centre(pair: Callable[..., Simulation], aside: float) -> None:
    """A ball that moves by more than its diameter in a step is thrown back by a thin rod, with all of its energy."""
    rod = {"capsule": {"radius": 0.001, "length": 0.2}, "at": [0.2, aside, 0.0], "fixed": True}
    ball = {"sphere": {"radius": 0.02}, "density": 800, "at": [0.1, 0.0, 0.0], "restitution": 1.0}
    away = {"bodies.two.at": [0.9, 0.0, 0.0], "bodies.two.friction": 0.0}
    simulation = pair(more={"bodies.one": ball, "obstacles": {"rod": rod}, "dynamics.step": 0.005, **away})
    kick(simulation, one=((10.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    advance(simulation, count=3)
    body = simulation.scene.rigid_bodies[0]
    found = simulation.stepper.velocities(simulation.state)[body.vertices].mean(axis=0)
    normal = np.array([-math.sqrt(1.0 - (aside / 0.021) ** 2), -aside / 0.021, 0.0])
    assert found @ normal > -5.0 * normal[0]  # a mirror at the entry gives twice as much
    np.testing.assert_allclose(np.linalg.norm(found), 10.0, rtol=1e-6)


@pytest.mark.parametrize("scheme", ["bdf2", "generalised_alpha", "newmark"])
def test_a_turning_body_goes_on_turning(pair: Callable[..., Simulation], scheme: str) -> None:
    """A tumbling box in free flight keeps its kinetic energy for hundreds of steps."""
    simulation = pair(more={"dynamics.scheme": scheme, "bodies.two.at": [0.9, 0.0, 0.0]})
    kick(simulation, one=((0.1, 0.0, 0.0), (3.0, 10.0, 2.0)))
    advance(simulation, count=20)
    first = simulation.result.energies["kinetic"]
    advance(simulation, count=400)
    assert simulation.result.energies["kinetic"] == pytest.approx(first, rel=0.02)


@pytest.mark.parametrize("scheme", ["bdf2", "generalised_alpha"])
def test_what_falls_does_not_spring_back(pair: Callable[..., Simulation], scheme: str) -> None:
    """A box that hits the floor at any moment within a step rebounds by at most a tenth of the height of its fall."""
    for height in (0.030, 0.0305, 0.031, 0.0315):
        more = {
            "bodies.one.at": [0.1, 0, -0.1 + 0.02 + height],
            "bodies.two.at": [0.9, 0, 0],
            **FLOORED,
            "dynamics.scheme": scheme,
        }
        simulation, heights = pair(more=more), []
        for _ in range(90):
            simulation.step()
            heights.append(height + simulation.handle_pose("one").translation[2])
        landed = int(np.argmax(np.array(heights) < 1e-5))
        assert landed > 0
        assert max(heights[landed:]) < 0.1 * height


EDGES = pytest.mark.exact("corners lie on edges: by which face they leave is rounding's, and a step may not settle")


@pytest.mark.parametrize(
    ("size", "x", "near"),
    [pytest.param([0.04, 0.04, 0.04], 0.1, 0.05, marks=EDGES), ([0.03, 0.03, 0.04], 0.105, 1e-3)],
)
def test_a_stack_stands(pair: Callable[..., Simulation], size: list[float], x: float, near: float) -> None:
    """A box stands for 10 s on a box of the same size, or on one that it does not cover, with the right normal force.

    With boxes of the same size, corners lie on edges, and rounding decides through which face they leave. At seven of
    ten positions that differed by 1e-14 m, the contact force between the boxes equalled the upper one's weight to 3e-4
    in each of 60 steps; at the other three to 1.7e-3, 1.7e-2 and 2.4e-2.
    """
    more = {
        **STACKED,
        "bodies.two.box.size": size,
        "bodies.two.at": [x, 0, -0.0398],
        **FLOORED,
        "dynamics.step": 0.02,
    }
    simulation = pair(more=more)
    advance(simulation, count=100)
    before = [simulation.handle_pose(name) for name in ("one", "two")]
    advance(simulation, count=500)
    for pose, name in zip(before, ("one", "two"), strict=True):
        moved = np.subtract(simulation.handle_pose(name).translation, pose.translation)
        assert np.linalg.norm(moved) < 1e-6
    assert simulation.handle_pose("two").translation[2] == pytest.approx(-0.0002, abs=1e-6)
    weights = [9.81 * handle.mass for handle in simulation.scene.handles if handle.section == "bodies"]
    touches = simulation.result.contacts
    assert touches["one on floor"].presses.sum() == pytest.approx(sum(weights), rel=1e-3)
    between = touches["one on two"].presses.sum() + touches["two on one"].presses.sum()
    assert between == pytest.approx(weights[1], rel=near)
    assert list(touches) == contact_names(simulation.scene.handles)


@pytest.mark.parametrize("scheme", ["bdf2", "generalised_alpha", "newmark"])
def test_a_stack_that_is_dropped_comes_to_rest(scheme: str) -> None:
    """Three boxes fall onto a floor and onto each other by half a millimetre each, and stand still after 2 s."""
    simulation = stacked(3, scheme, gap=0.0005)
    advance(simulation, count=400)
    before = simulation.handle_pose("box_2").translation
    advance(simulation, count=20)
    assert simulation.handle_pose("box_2").translation == pytest.approx(before, abs=1e-8)
    push = sum(touch.presses.sum() for name, touch in simulation.result.contacts.items() if name.endswith("on floor"))
    assert push == pytest.approx(3 * 500 * 0.04**3 * 9.81, rel=1e-6)


def test_what_is_squeezed_between_obstacles_has_bounded_forces_and_recovers(pair: Callable[..., Simulation]) -> None:
    """A ram presses a ball 0.1 mm into a floor, which nothing can yield: it is told, and over when the ram leaves.

    Forces grew to 1e15 N, stayed when the ram had left, and did work of 1e13 J.
    """
    ram = {"box": {"size": [0.2, 0.2, 0.02]}, "at": [0.1, 0, -0.0495]}
    obstacles = {"floor": FLOORED["obstacles"]["floor"], "ram": ram}
    ball = {"sphere": {"radius": 0.02}, "mass": 0.1, "at": [0.1, 0, -0.08]}
    simulation = pair(more={**FLOORED, "obstacles": obstacles, "bodies.one": ball, "bodies.two.at": [0.9, 0, 0]})
    advance(simulation)
    for depth in (0.0006, 0.0006):
        result = simulation.step(Command(handles={"ram": Pose((0.0, 0.0, -depth))}))
        assert not result.converged
        assert "contact" in result.message
        assert max(np.abs(touch.forces).max(initial=0.0) for touch in result.contacts.values()) < 1e6
    simulation.step(Command(handles={"ram": Pose((0.0, 0.0, 0.001))}))
    result = advance(simulation, count=3)
    assert abs(result.energies["work"]) < 100.0
    np.testing.assert_allclose(result.contacts["one on floor"].forces.sum(axis=0), [0.0, 0.0, 0.1 * 9.81], atol=0.01)


@pytest.mark.parametrize(
    ("count", "scheme", "tolerance"), [(10, "bdf2", 1e-4), (5, "bdf2", 1e-5), (5, "generalised_alpha", 1e-5)]
)
def test_a_tall_stack_stands(count: int, scheme: str, tolerance: float) -> None:
    """Boxes on each other, of whose contact points any three would do, move by less than 10 nm in 0.2 s."""
    simulation = stacked(count, scheme, gap=0.0, tolerance=tolerance)
    advance(simulation, count=40)
    assert max(np.abs(simulation.handle_pose(f"box_{k}").translation).max() for k in range(count)) < 1e-8


def stacked(count: int, scheme: str, *, gap: float, tolerance: float = 1e-5) -> Simulation:
    """Return boxes above each other, each with a ``gap`` [m] to what is below it."""
    box = {"box": {"size": [0.04, 0.04, 0.04]}, "density": 500, "friction": 0.5}
    bodies = {f"box_{k}": {**box, "at": [0.3, 0, -0.08 + gap + (0.04 + gap) * k]} for k in range(count)}
    given = {**FLOORED, "bodies": bodies, "dynamics": {"scheme": scheme, "step": 0.005}}
    given["solver"] = {"tolerance": tolerance}
    return Simulation(scene_of(PAIR, overrides=given))


@pytest.mark.parametrize("scheme", ["bdf2", "generalised_alpha"])
def test_the_laws_have_a_solution_in_a_stack_of_five(monkeypatch: pytest.MonkeyPatch, scheme: str) -> None:
    """Five boxes stand; each problem of their points, of which any three would do, is solved to what counts."""
    left = []

    def solve(*given: Any) -> float:
        left.append(complementarity.solve_laws(*given) / max(given[-2:]))
        return left[-1] * max(given[-2:])

    monkeypatch.setattr(impulse, "solve_laws", solve)
    simulation, steps = stacked(5, scheme, gap=0.0), []
    forces = simulation.stepper.equilibrium.minimiser.contact_forces
    simulation.observe_energy(lambda *_: steps.append((forces.left, forces.accepted)))
    advance(simulation, count=10)
    assert all(violation <= accepted for violation, accepted in steps)
    assert max(left) <= 1.0
    assert max(np.abs(simulation.handle_pose(f"box_{k}").translation).max() for k in range(5)) < 1e-8


@pytest.mark.parametrize("slope", [0.4, 0.6])
def test_friction_holds_a_box_on_another(pair: Callable[..., Simulation], slope: float) -> None:
    """On a slope where the lower box sticks, the upper box stays below the friction coefficient and slides above it.

    The upper box is narrower, so that it reaches no edge: edges on edges penetrate each other
    (docs/theory/contact.md), and rounding decided when a box as wide as the lower one fell off.
    """
    cosine = 1.0 / math.hypot(1.0, slope)
    more = {
        **STACKED,
        "bodies.one.box.size": [0.16, 0.05, 0.04],
        "bodies.one.at": [0.2, 0, -0.0799],
        "bodies.two.at": [0.2, 0, -0.0398],
        "obstacles": {"floor": {"plane": [0, 0, 1], "at": [0, 0, -0.1], "fixed": True, "friction": 5.0}},
        "loads": {"weight": {"gravity": [9.81 * slope * cosine, 0, -9.81 * cosine]}},
        "handles": {"base": {"where": {"face": "z+"}, "fixed": True}},
        "solver.tolerance": 1e-5,
    }
    simulation, path = pair(more=more), []
    for _ in range(70):
        advance(simulation)
        path.append(simulation.handle_pose("two").translation[0])
    fit = np.polyfit(0.005 * np.arange(30, 70), path[30:], 2)
    wanted = max(0.0, 9.81 * cosine * (slope - 0.5))
    assert 2.0 * fit[0] == pytest.approx(wanted, rel=0.01, abs=1e-4)
    assert abs(simulation.handle_pose("one").translation[0]) < 1e-4


def test_bars_that_cross_lie_on_each_other(pair: Callable[..., Simulation]) -> None:
    """Crossed bars without a corner inside the other touch at points of their faces, which carry the upper bar."""
    more = {
        **STACKED,
        "bodies.one.box.size": [0.04, 0.12, 0.04],
        "bodies.two.box.size": [0.12, 0.04, 0.04],
        "bodies.one.at": [0.2, 0, -0.0799],
        "bodies.two.at": [0.2, 0, -0.0398],
        **FLOORED,
    }
    simulation = pair(more=more)
    advance(simulation, count=200)
    assert simulation.handle_pose("two").translation[2] == pytest.approx(-0.0002, abs=2e-5)


def test_points_lie_on_the_skin() -> None:
    """The contact points of a shape lie on its surface, cover its long sides, and include its corners."""
    box, tube = Box((0.02, 0.08, 0.04)), Cylinder(0.01, 0.05)
    away = np.abs(box.skin) / (0.5 * np.array(box.size))
    np.testing.assert_allclose(away.max(axis=1), 1.0)
    assert {tuple(point) for point in box.corners} <= {tuple(point) for point in box.skin}
    assert np.diff(np.unique(box.skin[:, 1].round(9))).max() <= 0.0201
    np.testing.assert_allclose(np.hypot(tube.skin[:, 0], tube.skin[:, 1]), tube.radius)
    assert np.diff(np.unique(tube.skin[:, 2].round(9))).max() <= tube.radius + 1e-9

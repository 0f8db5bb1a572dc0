# SPDX-License-Identifier: Apache-2.0
"""Blocks that land, stick and slide on a floor: iterations, penetration, acceleration and drift."""

from __future__ import annotations

import numpy as np
import pytest

from test.written import advance, simulate, trace

BLOCK = """
mesh: {bar: {size: [0.2, 0.1, 0.1], cells: [8, 4, 4]}}
materials: {soft: {law: neo_hookean, young: 0.2e+6, poisson: 0.45, density: 1000}}
handles: {}
obstacles: {floor: {plane: [0, 0, 1], at: [0, 0, -0.05], friction: 0.5}}
loads: {weight: {gravity: [0, 0, -9.81]}}
dynamics: {step: 0.005}
"""
SIZE = 0.2
MASS = 2.0


def test_a_block_lands_in_few_iterations_and_enters_nothing() -> None:
    """A block that falls half a millimetre takes at most ten iterations a step, and stays above the floor to 1e-9."""
    simulation = simulate(BLOCK, obstacles__floor__at=[0, 0, -0.0505])
    for _ in range(14):
        result = advance(simulation)
        assert result.iterations <= 10
        assert result.positions[:, 2].min() > -0.0505 - 1e-9 * SIZE


@pytest.mark.parametrize("scheme", ["bdf2", "generalised_alpha", "newmark"])
def test_the_published_force_is_the_weight(scheme: str) -> None:
    """The mean force of the floor on a damped block that settles is its weight, in long steps, with every scheme."""
    dynamics = {"scheme": scheme, "step": 0.01, "damping": {"viscosity": 500}}
    forces = trace(simulate(BLOCK, dynamics=dynamics), 80, lambda result: result.reactions["floor"][2])
    assert min(forces[20:]) > 0.0
    assert np.mean(forces[20:]) == pytest.approx(MASS * 9.81, rel=0.01)


@pytest.mark.parametrize(
    ("push", "scheme", "tolerance", "bound"),
    [
        (3.0, "bdf2", 1e-4, 1e-12),
        (6.0, "bdf2", 1e-4, 1e-6),
        (6.0, "bdf2", 1e-7, 1e-9),
        (6.0, "generalised_alpha", 1e-7, 1e-9),
        (6.0, "newmark", 1e-8, 1e-8),  # the block still vibrates
    ],
)
def test_a_pushed_block_sticks_or_slides(push: float, scheme: str, tolerance: float, bound: float) -> None:
    """Within the cone of friction a block stays; beyond it, its acceleration is constant, as exact as the tolerance."""
    dynamics = {"scheme": scheme, "step": 0.005, "damping": {"viscosity": 500}}
    given = {"loads__weight__gravity": [push, 0, -9.81], "solver": {"tolerance": tolerance}}
    simulation = simulate(BLOCK, dynamics=dynamics, **given)
    places = trace(simulation, 200, lambda result: result.positions[:, 0].mean())
    times, acceleration = 0.005 * np.arange(200), max(0.0, push - 0.5 * 9.81)
    assert 2.0 * np.polyfit(times[120:], places[120:], 2)[0] == pytest.approx(acceleration, abs=bound)
    if acceleration == 0.0:
        assert abs(places[-1] - places[-40]) < 1e-12 * SIZE


HELD = """
mesh: {bar: {size: [0.06, 0.02, 0.02], cells: [6, 2, 2]}}
materials: {soft: {law: neo_hookean, young: 1.0e+5, poisson: 0, density: 1000}}
handles: {base: {where: {face: x-}}, tip: {where: {face: x+}}}
obstacles: {floor: {plane: [0, 0, 1], at: [0, 0, -0.01], friction: 0.3}}
loads: {weight: {gravity: [0, 0, -30.0]}}
"""
LOOSE = [["x"], ["z"], ["x", "z"], ["x", "y", "z", "rx", "ry", "rz"]]


@pytest.mark.parametrize("dynamics", [None, {"scheme": "bdf2", "step": 0.005, "damping": {"viscosity": 500.0}}])
@pytest.mark.parametrize("free", LOOSE, ids="-".join)
def test_a_floor_carries_a_bar_whose_tip_is_held_in_some_directions(free: list[str], dynamics: dict | None) -> None:
    """Floor and handles balance the weight of a bar; points of the tip that cannot move towards the floor do not count.

    The compliance of such points along the normal was zero, and their forces were no numbers.
    """
    moves = {} if dynamics is None else {"dynamics": dynamics}
    simulation = simulate(HELD, handles__tip__free=free, **moves)
    for _ in range(2 if dynamics is None else 100):
        result = advance(simulation)
    up = {name: wrench[2] for name, wrench in result.reactions.items()}
    assert up["floor"] > 0.4
    assert sum(up.values()) == pytest.approx(0.72, rel=0.05 if dynamics else 1e-3)
    assert result.positions[:, 2].min() > -0.01 - 1e-9

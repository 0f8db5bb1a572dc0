# SPDX-License-Identifier: Apache-2.0
"""Saved states: what follows is the same to the last bit; what is no state, or another scene's, is refused."""

from __future__ import annotations

import json
import pickle
import zlib

import numpy as np
import pytest

from gdfe_ros.checkpoint import _MAGIC, load_state, save_state
from gdfe_ros.constraints import Pose
from gdfe_ros.errors import GdfeError
from gdfe_ros.scene.loader import load_scene
from gdfe_ros.simulation import Command, Simulation


def _simulation(scene: str = "bend5", **overrides: object) -> Simulation:
    return Simulation(load_scene(scene, overrides={"mesh.bar.cells": [10, 2, 2], **overrides}))


def _command(step: int) -> Command:
    return Command(handles={"tip": Pose((0.0, 1e-3 * step, 2e-3 * step))})


@pytest.mark.parametrize("scene", ["bend5", "twist90", "tensile_curve"])
@pytest.mark.parametrize("policy", ["energy", "relative"])
def test_a_restored_simulation_goes_on_to_the_bit(scene: str, policy: str) -> None:
    """Save in the middle of a motion, restore into a fresh simulation: both make the same steps."""
    first, second = (_simulation(scene, **{"solver.policy": policy}) for _ in range(2))
    for step in range(6):
        first.step(_command(step), dt=0.1)
    load_state(second, save_state(first))
    assert np.array_equal(first.positions, second.positions)
    for step in range(6, 10):
        one, two = (simulation.step(_command(step), dt=0.1) for simulation in (first, second))
        assert np.array_equal(one.positions, two.positions)
        assert (one.time, one.residual, one.energy) == (two.time, two.residual, two.energy)


def test_a_state_can_be_restored_more_than_once() -> None:
    """Go on from the same state twice in one simulation: the same steps."""
    simulation = _simulation()
    simulation.step(_command(3), dt=0.1)
    state, results = save_state(simulation), []
    for _ in range(2):
        load_state(simulation, state)
        results.append(simulation.step(_command(5), dt=0.1).positions)
    assert np.array_equal(*results)


def test_a_state_of_another_scene_is_refused() -> None:
    """Load a state into another scene, or other settings: the error says what differs, nothing changes."""
    state = save_state(_simulation())
    other = _simulation("twist90")
    before = other.positions.copy()
    with pytest.raises(GdfeError, match="does not fit: its scene is"):
        load_state(other, state)
    assert np.array_equal(other.positions, before)


def test_damaged_and_hostile_states_are_refused() -> None:
    """Load noise, a cut state, and a pickle that would run a program: an error, and nothing runs."""
    simulation = _simulation()
    state = save_state(simulation)
    head = state[len(_MAGIC) :].partition(b"\n")[0]
    hostile = zlib.compress(pickle.dumps(_Hostile()))
    for data in (b"noise", state[:-20], _MAGIC + b"{}\n", _MAGIC + b"x\n", _MAGIC + head + b"\n" + hostile):
        with pytest.raises(GdfeError):
            load_state(simulation, data)
    assert json.loads(head)["version"]


class _Hostile:
    def __reduce__(self) -> tuple:
        return (print, ("this must not run",))

# SPDX-License-Identifier: Apache-2.0
"""A simulation continues in a scene with other rigid bodies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints import Pose
from gdfe_ros.errors import OverlapError
from gdfe_ros.node.driving.remodelling import take_over
from gdfe_ros.scene import load_scene
from gdfe_ros.scene.entity import Entity, read_entity, with_body, without_bodies
from gdfe_ros.simulation import Command, Simulation
from test.written import advance

_PLACE = np.array([0.3, 0.0, 0.05])


@pytest.fixture
def cube() -> Entity:
    """Give a cube of 20 g."""
    return read_entity("{box: {size: [0.03, 0.03, 0.03]}, mass: 0.02, friction: 0.4}")


def test_the_account_of_energy_continues(slab: Path, cube: Entity) -> None:
    """A body that joins or leaves in mid-fall changes work as much as energy; the account then closes as before."""
    old = Simulation(load_scene(slab))
    advance(old, dt=0.005, count=5)
    new = Simulation(with_body(old.scene, "cube", cube, origin=_PLACE, turn=Rotation.identity()))
    take_over(old, new)
    assert new.time == old.time
    assert new.stepper.find_imbalance(new.state) == pytest.approx(old.stepper.find_imbalance(old.state), abs=1e-15)
    advance(new, dt=0.005, count=5)
    last = Simulation(without_bodies(new.scene, ["cube"]))
    take_over(new, last)
    assert last.stepper.find_imbalance(last.state) == pytest.approx(new.stepper.find_imbalance(new.state), abs=1e-15)
    assert last.stepper.energies(last.state)["kinetic"] < new.stepper.energies(new.state)["kinetic"]
    for _ in range(5):
        assert last.step(dt=0.005).converged
        old.step(dt=0.005)
        old.step(dt=0.005)
    assert np.abs(last.positions - old.positions).max() < 2.0 * old.settings.tolerance * old.mesh.size


def test_a_body_does_not_join_where_another_one_is_now(slab: Path, cube: Entity) -> None:
    """Where the part has moved since rest is no place for a new body; the old simulation is unchanged."""
    old = Simulation(load_scene(slab))
    old.step(dt=0.005)
    place = np.add(old.handle_pose("part").translation, [1.0, 0.0, 0.0])
    old.step(Command(bodies={"part": Pose(tuple(place))}), dt=0.005)
    before = old.positions.copy()
    body = next(handle for handle in old.scene.handles if handle.name == "part")
    new = Simulation(with_body(old.scene, "cube", cube, origin=body.origin + place, turn=Rotation.identity()))
    with pytest.raises(OverlapError, match="inside of"):
        take_over(old, new)
    assert (old.positions == before).all()

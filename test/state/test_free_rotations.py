# SPDX-License-Identifier: Apache-2.0
"""Several free rotations of a handle beside a commanded one: least energy, within the allowed iterations."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.errors import CommandError
from test.written import advance

BASE = "base: {where: {face: x-}, fixed: true}"
CELLS = {"mesh__bar__cells": [4, 2, 2]}
CONSERVATIVE = {"materials__rubber": {"law": "linear", "young": 1.0e6, "poisson": 0.45}}
"""The linear law: its hourglass stiffness is constant, so that its forces are the exact gradient of its energy."""
TWIST = 1.2
"""Commanded rotation about z [rad]; the handle turns freely about x and y."""
OFFSETS = [(-0.02, 0.03, 0.02), (-0.03, 0.03, 0.01), (0.0, 0.02, 0.02)]


def twisted(offset: tuple[float, float, float]) -> Pose:
    """Return the commanded pose: an offset [m] and the rotation about z."""
    return Pose(offset, (0.0, 0.0, TWIST))


def hinged(lab: Any, free: str = "rx, ry", **keys: object) -> Simulation:
    """Return the bar whose tip turns freely about the given axes."""
    handles = f"{BASE}, tip: {{where: {{face: x+}}, free: [{free}]}}"
    return lab.bar(handles=handles, actuators="", **CELLS, **keys)


class Commanded:
    """The bar with every rotation of its tip commanded.

    Args:
        lab: the bar.
        near: pose of the tip at the start.
    """

    def __init__(self, lab: Any, near: Pose) -> None:
        handles = f"{BASE}, tip: {{where: {{face: x+}}}}"
        scene = lab.scene(handles=handles, actuators="", solver__tolerance=1e-7, **CELLS, **CONSERVATIVE)
        self._simulation, self._near = Simulation(scene), near
        self._simulation.step(Command(handles={"tip": near}))

    def energy(self, swing: np.ndarray) -> float:
        """Return the equilibrium's energy [J], the tip rotated about z as commanded, then by ``swing`` (2,) [rad]."""
        turn = Rotation.from_rotvec([*swing, 0.0]) * Rotation.from_rotvec([0.0, 0.0, TWIST])
        pose = Pose(self._near.translation, tuple(turn.as_rotvec()))
        result = advance(self._simulation, Command(handles={"tip": pose}))
        return result.energy


@pytest.mark.parametrize("parts", [1, 6])
@pytest.mark.parametrize("offset", OFFSETS)
def test_two_free_rotations_reach_the_minimum(lab: Any, offset: tuple[float, float, float], parts: int) -> None:
    """With an offset and a rotation about z, no other rotation about x and y has less energy."""
    simulation = hinged(lab, **CONSERVATIVE)
    for part in range(1, parts + 1):
        result = lab.go(simulation, Pose().blend(twisted(offset), part / parts))
    assert result.converged, result.message
    pose = simulation.handle_pose("tip")
    np.testing.assert_allclose(pose.translation, offset, atol=1e-12)
    swing = (Rotation.from_rotvec(pose.rotation) * Rotation.from_rotvec([0.0, 0.0, TWIST]).inv()).as_rotvec()
    assert abs(swing[2]) < 1e-9, "the commanded turn about z is kept"
    commanded = Commanded(lab, pose)
    found = minimize(commanded.energy, swing[:2], method="Nelder-Mead", options={"xatol": 1e-4, "maxfev": 80})
    assert result.energy <= found.fun * (1.0 + 1e-4)
    assert np.rad2deg(np.linalg.norm(found.x - swing[:2])) < 0.2


def test_the_way_to_free_rotations_does_not_matter(lab: Any) -> None:
    """One step, five steps and a detour to a command lead to the same equilibrium."""
    target, found = twisted(OFFSETS[0]), []
    for way in ([target], [Pose().blend(target, part / 5) for part in range(1, 6)], [Pose((0.0, 0.01, 0.0)), target]):
        simulation = hinged(lab)
        for pose in way:
            result = lab.go(simulation, pose)
        assert result.converged, result.message
        found.append(result.positions)
    for one, other in pairwise(found):
        assert lab.distance(one, other, simulation.mesh) < 1e-3


@pytest.mark.parametrize("most", [50, 100, 200, 400, 700])
@pytest.mark.parametrize("free", ["rx", "rx, ry", "rx, ry, rz"])
def test_turning_handles_keep_to_the_iterations(lab: Any, free: str, most: int) -> None:
    """With few iterations allowed, no step takes more, unfinished steps say so, and further steps converge."""
    simulation = hinged(lab, free, solver__max_iterations=most)
    pose = Pose((0.0, 0.02, 0.02), (0.0, 0.0, 0.0 if "rz" in free else TWIST))
    results = []
    while len(results) < 60 and not (results and results[-1].converged):
        results.append(lab.go(simulation, pose))
    assert max(result.iterations for result in results) <= most
    assert all(result.message for result in results[:-1])
    assert results[-1].converged, results[-1].message


@pytest.mark.exact("it compares with the vertices of the mesh to the bit")
@pytest.mark.parametrize("onto", ["a point", "a line"])
def test_positions_that_hide_a_rotation_are_refused(lab: Any, onto: str) -> None:
    """A flattened handle that turns freely has no defined rotation: the error names the handle."""
    tip = "tip: {where: {face: x+}, free: [rx, ry, rz]}"
    simulation = lab.bar(handles=f"{BASE}, {tip}", actuators="")
    positions = simulation.mesh.vertices.copy()
    end = positions[:, 0] > 0.0999
    positions[end, 1:] *= 0.0 if onto == "a point" else (1.0, 0.0)
    with pytest.raises(CommandError, match=r"'tip' turns freely.*remedy: give positions"):
        simulation.set_positions(positions)
    assert np.array_equal(simulation.positions, simulation.mesh.vertices)

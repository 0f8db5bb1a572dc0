# SPDX-License-Identifier: Apache-2.0
"""The measured pneumatic arm: its recordings checked without a simulation, and its mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.measured_arm.__main__ import MATERIAL, fitted, recorded
from benchmarks.measured_arm.arc import turned
from benchmarks.measured_arm.scene import arm_scene
from benchmarks.measured_arm.section import LENGTH, OUTER, Section


def test_the_arm_is_an_arc_of_constant_length_in_a_turned_frame() -> None:
    """Beyond 50 mbar the measured paths are arcs within 4 % on average, in a frame turned by 17 to 21 degrees."""
    data = recorded()
    ratios, angles = turned(data["axial"], data["lateral"], data["tilt"], LENGTH)
    assert abs(np.mean(ratios[1:]) - 1.0) < 0.04
    assert np.abs(ratios - 1.0).max() < 0.11
    assert np.rad2deg(angles).min() > 17.0
    assert np.rad2deg(angles).max() < 21.0


def test_the_mesh_has_the_published_dimensions(tmp_path: Path) -> None:
    """The meshed arm has the published radius and length, and a closed chamber that the actuator uses."""
    scene = arm_scene(tmp_path, Section(), MATERIAL)
    rest = scene.mesh.vertices
    np.testing.assert_allclose(np.hypot(rest[:, 0], rest[:, 1]).max(), OUTER, rtol=1e-6)
    np.testing.assert_allclose(rest[:, 2].max(), LENGTH, rtol=1e-6)
    assert [each.name for each in scene.actuators] == ["air"]


def test_a_modulus_comes_back_from_its_own_curve() -> None:
    """With the recording of a model twice as soft as its curve, the fit finds the factor 2 and predicts all values."""
    data = recorded()
    start = np.array([[0.0, 0.0, 0.0]])
    curve = np.vstack([start, np.column_stack([0.5 * data["pressure"], data["total"], data["tilt"]])])
    curve = np.vstack([curve, 1.1 * curve[-1]])  # a fit that is off by a rounding must not leave the curve
    modulus, ratios = fitted(curve)
    np.testing.assert_allclose(modulus, 2.0, rtol=1e-3)
    np.testing.assert_allclose(ratios, 1.0, rtol=1e-3)

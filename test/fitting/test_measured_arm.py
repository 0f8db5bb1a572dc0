# SPDX-License-Identifier: Apache-2.0
"""The measured pneumatic arm: its recordings checked without a simulation, and its mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.measured_robots.arm_body import LENGTH, OUTER, YOUNG, Section, arm_scene, recorded


def turned(axial: np.ndarray, lateral: np.ndarray, tilt: np.ndarray, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the ratio of the measured displacement to that of an arc (k,), and the angle between both (k,) [rad].

    If an arc of constant length L ends at the angle t, its tip has moved by L (1 - cos t) / t laterally and by
    L (1 - sin t / t) towards the base.
    """
    along, aside = -length * (1.0 - np.sin(tilt) / tilt), length * (1.0 - np.cos(tilt)) / tilt
    ratio = np.hypot(axial, lateral) / np.hypot(along, aside)
    return ratio, np.arctan2(-axial, lateral) - np.arctan2(-along, aside)


def test_the_arm_is_an_arc_of_constant_length_in_a_turned_frame() -> None:
    """Beyond 50 mbar the measured paths are arcs within 4 % on average, in a frame turned by 17 to 21 degrees."""
    data = recorded()
    ratios, angles = turned(data["axial"], data["lateral"], data["tilt"], LENGTH)
    assert abs(np.mean(ratios[1:]) - 1.0) < 0.04
    assert np.abs(ratios - 1.0).max() < 0.11
    assert np.abs(ratios[1:] - 1.0).max() < 0.07
    assert np.rad2deg(angles).min() > 17.0
    assert np.rad2deg(angles).max() < 21.0


def test_the_mesh_has_the_published_dimensions(tmp_path: Path) -> None:
    """The meshed arm has the published radius and length, and a closed chamber that the actuator uses."""
    scene = arm_scene(tmp_path, Section(), {"law": "neo_hookean", "young": YOUNG, "poisson": 0.45, "density": 1070.0})
    rest = scene.mesh.vertices
    np.testing.assert_allclose(np.hypot(rest[:, 0], rest[:, 1]).max(), OUTER, rtol=1e-6)
    np.testing.assert_allclose(rest[:, 2].max(), LENGTH, rtol=1e-6)
    assert [each.name for each in scene.actuators] == ["air"]

# SPDX-License-Identifier: Apache-2.0
"""Drucker's stability check: which laws are reported as unstable, in which mode, and from which stretch."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.torture.bodies import BAR, make_scene
from gdfe_ros.materials import Law, Linear, Ogden, preset
from gdfe_ros.materials.drucker import MODES, drucker_remarks, separable_hessian
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.settings import Policy


def _stress(material: Ogden, stretches: tuple[float, ...]) -> np.ndarray:
    """Return the principal Kirchhoff stresses tau_i = sum 2 mu/alpha l_i^alpha, minus the third of them."""
    tau = [sum(2 * m / a * s**a for m, a in zip(material.mu, material.alpha, strict=True)) for s in stretches]
    return np.array(tau[:2]) - tau[2]


@pytest.mark.parametrize("poisson", [0.3, 0.495])
def test_sound_laws_pass(poisson: float) -> None:
    """Neo-Hookean, Mooney-Rivlin and NinjaFlex as Ogden laws give no remark."""
    assert Ogden(mu=(1e5,), alpha=(2.0,), poisson=poisson).remarks() == []
    assert Ogden(mu=(1e5, 2e4), alpha=(2.0, -2.0), poisson=poisson).remarks() == []
    assert preset("ninjaflex", law=Law.OGDEN, poisson=poisson).remarks() == []


def test_cheetah_is_told_unstable_where_its_stress_falls() -> None:
    """Cheetah (Table 1) is unstable from the equibiaxial stretch at which its stress, computed here, falls."""
    material = preset("cheetah", law=Law.OGDEN, poisson=0.49)
    told = next(text for text in material.remarks() if "equibiaxial tension" in text)
    limit = float(told.split("stretch ")[1].split(" ")[0])

    def least(stretch: float) -> float:
        step, third = 1e-5, stretch**-2.0
        columns = []
        for axis in range(2):
            logs = np.log([stretch, stretch, third])
            logs[axis] += step
            logs[2] -= step
            ahead = _stress(material, tuple(np.exp(logs)))
            logs[axis] -= 2 * step
            logs[2] += 2 * step
            columns.append((ahead - _stress(material, tuple(np.exp(logs)))) / (2 * step))
        return float(np.linalg.eigvalsh(np.array(columns)).min())

    assert least(limit * 0.97) > 0.0
    assert least(limit * 1.03) < 0.0


def test_every_mode_is_volume_preserving() -> None:
    """Every mode of the check has stretches with product one."""
    for mode in MODES.values():
        np.testing.assert_allclose(np.prod(mode(np.array([0.5, 2.0])), axis=0), 1.0, rtol=1e-14)


def test_a_law_that_loses_all_stiffness_is_unstable_everywhere() -> None:
    """A law with negative stiffness gives six remarks, from stretch 1 on."""
    notes = drucker_remarks(separable_hessian(lambda stretch: -np.ones_like(stretch)))
    assert len(notes) == 6
    assert all("from stretch 1 on" in note for note in notes)


def test_simulation_collects_remarks() -> None:
    """A simulation's remarks name the material, and under ``relative`` a contrast beyond the calibration."""
    materials = [preset("cheetah", law=Law.OGDEN, poisson=0.49), Linear(young=1.0, poisson=0.3)]
    cells = (BAR.centroids[:, 0] > 0.2).astype(np.int32)
    energy, relative = (
        Simulation(make_scene(BAR, materials, policy=policy, cell_material=cells)).remarks() for policy in Policy
    )
    assert all(note.startswith("material 'm0': unstable") for note in energy)
    assert energy
    assert [note for note in relative if "beyond the calibration" in note]

# SPDX-License-Identifier: Apache-2.0
"""The stable neo-Hookean law in small strains, in motion, and after an inversion."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.materials import StableNeoHookean
from test.written import advance, scene_of

BAR = """
mesh: {{bar: {{size: [0.1, 0.02, 0.02], cells: [10, 2, 2]}}}}
materials: {{rubber: {{law: {law}, young: {young}, poisson: {poisson}, density: 1000}}}}
handles: {{low: {{where: {{face: x-}}, fixed: true}}, high: {{where: {{face: x+}}}}}}
solver: {{tolerance: 1.0e-9}}
"""


def pulled(law: str, poisson: float, shift: float, young: float = 1e5) -> float:
    """Return the pull [N] on a bar of 0.1 m that is longer by ``shift`` [m]."""
    simulation = Simulation(scene_of(BAR.format(law=law, young=young, poisson=poisson)))
    result = advance(simulation, Command(handles={"high": Pose((shift, 0.0, 0.0))}))
    return float(result.reactions["high"][0])


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.49, 0.4999, 0.5])
def test_small_strains_are_those_of_the_linear_law(poisson: float) -> None:
    """A bar that is longer by 1e-4 of its length has the force of the linear law with the same moduli, for every nu."""
    assert pulled("stable_neo_hookean", poisson, 1e-5) == pytest.approx(pulled("linear", poisson, 1e-5), rel=1e-3)


def test_the_volume_energy_has_the_papers_lambda() -> None:
    """The modulus of the volume energy is lambda + 5/6 mu, and the energy of the rest shape is stress free."""
    law = StableNeoHookean(young=1e5, poisson=0.3)
    lame = 2.0 * law.shear0 * 0.3 / 0.4
    assert law.volume_modulus == pytest.approx(lame + 5.0 / 6.0 * law.shear0)
    assert float(law.stress_at(np.zeros(1))[0]) == 0.0


def test_a_released_bar_swings_like_the_neo_hookean_one() -> None:
    """Small motions under gravity are those of the neo-Hookean law, to 1 % of the largest deflection."""
    paths = []
    for law in ("neo_hookean", "stable_neo_hookean"):
        text = BAR.format(law=law, young=1e6, poisson=0.4).replace(", high: {where: {face: x+}}", "")
        text = text.replace("1.0e-9", "1.0e-5") + (
            "loads: {weight: {gravity: [0, 0, -9.81]}}\ndynamics: {step: 0.005}\nprobes: {tip: [0.1, 0, 0]}\n"
        )
        simulation = Simulation(scene_of(text))
        path = []
        for _ in range(40):
            assert simulation.step().converged
            path.append(simulation.probe_positions()["tip"][2])
        paths.append(np.array(path))
    assert np.abs(paths[1] - paths[0]).max() < 0.01 * np.abs(paths[0] - paths[0][0]).max()


def test_a_block_through_itself_comes_back() -> None:
    """A block whose end was moved through the other end, so that its cells are inside out, comes back to rest."""
    simulation = Simulation(scene_of(BAR.format(law="stable_neo_hookean", young=1e5, poisson=0.45)))
    for shift in (-0.16, 0.0):
        result = simulation.step(Command(handles={"high": Pose((shift, 0.0, 0.0))}))
        assert np.isfinite(result.positions).all()
    assert result.converged, result.message
    assert np.abs(result.positions - simulation.mesh.vertices).max() < 1e-5

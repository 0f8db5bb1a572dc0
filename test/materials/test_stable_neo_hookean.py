# SPDX-License-Identifier: Apache-2.0
"""The stable neo-Hookean law in small strains, in motion, and after an inversion."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
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


def test_a_block_through_itself_comes_back() -> None:
    """A block whose end was moved through the other end, so that its cells are inside out, comes back to rest."""
    simulation = Simulation(scene_of(BAR.format(law="stable_neo_hookean", young=1e5, poisson=0.45)))
    for shift in (-0.16, 0.0):
        result = simulation.step(Command(handles={"high": Pose((shift, 0.0, 0.0))}))
        assert np.isfinite(result.positions).all()
    assert result.converged, result.message
    assert np.abs(result.positions - simulation.mesh.vertices).max() < 1e-5

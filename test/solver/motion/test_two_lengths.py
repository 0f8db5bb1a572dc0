# SPDX-License-Identifier: Apache-2.0
"""Motion with steps of two lengths in turn, and energies beside a growth actuator."""

from __future__ import annotations

import pytest

from gdfe_ros import Simulation
from test.written import advance, scene_of

BAR = """
mesh: {bar: {size: [0.12, 0.02, 0.02], cells: [8, 2, 2]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.45, density: 1100}}
handles: {base: {where: {face: x-}}}
loads: {weight: {gravity: [0, 0, -9.81]}}
dynamics: {step: 0.005}
"""
GROWTH = "actuators: {g: {growth: {stretch: [1.2, 1, 1]}}}\n"


@pytest.mark.parametrize("short", [0.00006, 0.0005, 0.002])
@pytest.mark.parametrize("scheme", ["bdf2", "generalised_alpha"])
def test_steps_of_two_lengths_in_turn_make_no_energy(scheme: str, short: float) -> None:
    """A bar that swings in steps of two lengths in turn gains hardly any energy, without damping."""
    allowed, fastest = {"bdf2": 0.005, "generalised_alpha": 0.03}[scheme], 0.0
    simulation = Simulation(scene_of(BAR, overrides={"dynamics.scheme": scheme}))
    for step in range(60):
        result = advance(simulation, dt=(0.005, short)[step % 2])
        total = sum(result.energies[name] for name in ("kinetic", "elastic", "potential"))
        fastest = max(fastest, result.energies["kinetic"])
        assert total <= 1e-9 + allowed * fastest, step


def test_growth_does_not_hide_the_potential() -> None:
    """A growth actuator that is never commanded changes none of the reported energies."""
    plain, grown = (Simulation(scene_of(BAR + more)) for more in ("", GROWTH))
    for _ in range(10):
        expected, found = plain.step(dt=0.01).energies, grown.step(dt=0.01).energies
    assert expected["potential"] < -1e-4
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-12)

# SPDX-License-Identifier: Apache-2.0
"""A simulation owns its state: growth, saved states, deferred fields and results do not affect each other."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gdfe_ros.checkpoint import load_state, save_state


def equal(one: Any, other: Any) -> bool:
    """Return whether two results have the same positions and numbers to the last bit."""
    numbers = ("converged", "iterations", "error_estimate", "energy", "min_det", "message")
    return np.array_equal(one.positions, other.positions) and all(
        getattr(one, name) == getattr(other, name) for name in numbers
    )


# --- saved states ---


@pytest.mark.exact("it compares with the vertices of the mesh to the bit")
@pytest.mark.parametrize("poisson", [0.3, 0.499, 0.5])
def test_a_saved_rest_is_rest_after_growth(lab: Any, poisson: float) -> None:
    """An undeformed state, loaded into a grown simulation, continues as if it had never grown, also after a reset."""
    how = {"materials__rubber__poisson": poisson}
    grown, plain = lab.bar(**how), lab.bar(**how)
    rest = save_state(lab.bar(**how))
    lab.go(grown, heat=1.0)
    load_state(grown, rest)
    assert np.array_equal(grown.positions, grown.mesh.vertices)
    assert equal(lab.go(grown, pull=0.05), lab.go(plain, pull=0.05))
    grown.reset()
    plain.reset()
    assert equal(lab.go(grown, heat=0.2), lab.go(plain, heat=0.2))


def test_a_watched_simulation_can_be_saved(lab: Any) -> None:
    """A simulation with an energy observer can be saved; its copy has the same next step and no observer."""
    first, second, seen = lab.bar(), lab.bar(), []
    first.observe_energy(lambda *values: seen.append(values))
    lab.go(first, pull=0.3)
    load_state(second, save_state(first))
    count = len(seen)
    assert count > 0
    after = lab.go(second, pull=0.4)
    assert len(seen) == count
    assert equal(lab.go(first, pull=0.4), after)
    assert len(seen) > count


# --- a start from given positions, and a restart from rest ---


# --- jacobians ---


@pytest.mark.parametrize("way", [(0.1, 0.0), (1.0, 0.0), (0.3, 0.6, 1.0, 0.5, 0.0)])
def test_relative_with_growth_comes_home(lab: Any, way: tuple[float, ...]) -> None:
    """With the policy ``relative``, a body that grows and shrinks returns within ten tolerances."""
    simulation = lab.bar(actuators="heat: {growth: {stretch: [0.9, 1, 1], where: {box: {z: [0, 1]}}}}",
                         more="solver: {policy: relative}")  # fmt: skip
    for heat in way:
        result = lab.go(simulation, heat=heat)
        assert result.converged
    off = lab.distance(result.positions, simulation.mesh.vertices, simulation.mesh)
    assert off <= 10.0 * simulation.settings.tolerance


# --- fields and results of the past ---


def test_results_and_positions_cannot_change_the_simulation(lab: Any) -> None:
    """Writing into a result or into the positions is refused, or has no effect on the state and the next step."""
    simulation, plain = lab.bar(), lab.bar()
    for each in (simulation, plain):
        lab.go(each, pull=0.3)
    for array in (simulation.result.positions, simulation.positions, simulation.result.reactions["base"]):
        try:
            array += 1.0
        except ValueError as error:
            assert "read-only" in str(error)  # noqa: PT017 - either answer is sound
    assert np.array_equal(simulation.positions, plain.positions)
    assert equal(lab.go(simulation, pull=0.4), lab.go(plain, pull=0.4))

# SPDX-License-Identifier: Apache-2.0
"""One thread for BLAS while a slender body is solved, and as many as before afterwards."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from threadpoolctl import ThreadpoolController

from gdfe_ros import Simulation, load_scene
from gdfe_ros.solver.tangent.band import Band


def counts() -> set[int]:
    """Return how many threads the libraries of BLAS would use now."""
    return {library.num_threads for library in ThreadpoolController().select(user_api="blas").lib_controllers}


def test_a_slender_body_is_solved_with_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """Allow two threads and take a step of a body with a band: each factor is made with one, two are left after it."""
    simulation, seen = Simulation(load_scene("swinging_arm")), []

    def watched(factor: Band, blocks: object, *, original: Callable = Band.factor) -> bool:
        seen.append(counts())
        return original(factor, blocks)

    monkeypatch.setattr(Band, "factor", watched)
    with ThreadpoolController().limit(limits=2, user_api="blas"):
        simulation.step(dt=0.05)
        assert counts() == {2}
    assert seen
    assert all(count == {1} for count in seen)

# SPDX-License-Identifier: Apache-2.0
"""Every feature with every operation that copies or repeats a state: results are equal to the last bit."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gdfe_ros import Command, Simulation
from gdfe_ros.checkpoint import load_state, save_state
from gdfe_ros.errors import CommandError, GdfeError
from gdfe_ros.scene import scene_from_text
from test.state.pairs.conftest import FEATURES, HISTORIES, Feature

EVERY = {**FEATURES, **HISTORIES}
WRONG = Command(actuators={"nobody": 1.0}), Command(loads={"nobody": 1.0})


@pytest.fixture(scope="session", params=EVERY)
def feature(request: pytest.FixtureRequest) -> Feature:
    """Give each feature in turn, also those whose states depend on their paths."""
    return EVERY[request.param]()


def test_the_feature_is_at_work(feature: Any) -> None:
    """On its path, the body moves, ends in equilibrium, and its feature is active."""
    last, mesh = feature.results[-1], feature.scene.mesh
    assert last.converged, last.message
    assert np.abs(last.positions - mesh.vertices).max() > 1e-4 * mesh.size
    assert feature.seen(feature.results), "the way does not reach what it is for"


# --- once more ---


def test_replay_of_the_scene_read_anew(feature: Any, differences: Any) -> None:
    """The same steps in a scene read from its own text give the same bits."""
    simulation = Simulation(scene_from_text(feature.scene.source))
    assert not differences.run(feature.run(simulation, feature.way), feature.results)


def test_reset_and_again(feature: Any, differences: Any) -> None:
    """After steps, another path and a reset, the same steps give the same bits, also a second time."""
    simulation, fresh = feature.simulation(), feature.simulation()
    for _ in range(2):
        feature.run(simulation, feature.way + feature.elsewhere)
        simulation.reset()
        assert not differences.state(simulation, fresh)
    assert not differences.run(feature.run(simulation, feature.way), feature.results)


# --- side by side ---


def test_two_in_turn(feature: Any, differences: Any) -> None:
    """Two simulations of one scene, stepped in turn on different load paths, each have the bits they have alone."""
    one, other, found = feature.simulation(), feature.simulation(), []
    for index, step in enumerate(feature.way):
        feature.run(other, [feature.elsewhere[index % 2]])
        found += feature.run(one, [step])
    assert not differences.run(found, feature.results)


def test_two_threads_at_the_same_time(feature: Any, differences: Any) -> None:
    """Two simulations of one scene in two threads each have the bits they have alone."""
    simulations, found = [feature.simulation(), feature.simulation()], {}
    barrier = threading.Barrier(2)

    def work(index: int) -> None:
        barrier.wait()
        found[index] = feature.run(simulations[index], feature.way)

    threads = [threading.Thread(target=work, args=(index,)) for index in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for index in range(2):
        assert not differences.run(found[index], feature.results)


# --- saved and loaded ---


@pytest.mark.parametrize("where", ["fresh", "elsewhere", "itself"])
def test_checkpoint(feature: Any, differences: Any, where: str) -> None:
    """A state saved midway and loaded into a fresh, a used or the same simulation continues with the same bits."""
    half = len(feature.way) // 2
    first = feature.simulation()
    feature.run(first, feature.way[:half])
    state = save_state(first)
    second = first if where == "itself" else feature.simulation()
    if where != "fresh":
        feature.run(second, feature.elsewhere)
    load_state(second, state)
    if where != "itself":
        assert not differences.state(second, first)
    for simulation in {id(item): item for item in (second, first)}.values():
        assert not differences.run(feature.run(simulation, feature.way[half:]), feature.results[half:])


# --- fields of the past ---


def test_deferred_fields(feature: Any, differences: Any) -> None:
    """Fields taken at every step and evaluated later in another thread have the same bits."""
    simulation, now, later = feature.simulation(), [], []
    for step in feature.way:
        feature.run(simulation, [step])
        later.append(simulation.later_fields())
        now.append(simulation.fields())
    feature.run(simulation, feature.elsewhere)
    found: list[Any] = []
    thread = threading.Thread(target=lambda: found.extend(evaluate() for evaluate in later))
    thread.start()
    feature.run(simulation, feature.way[:1])
    thread.join()
    for one, other in zip(found, now, strict=True):
        assert not differences.fields(one, other)


# --- what must not change a thing ---


def test_a_refused_command_changes_nothing(feature: Any, differences: Any) -> None:
    """Refused commands between any two steps leave the steps' bits unchanged."""
    simulation, found = feature.simulation(), []
    for step in feature.way:
        for wrong in (*WRONG, Command(actuators={feature.lever[0]: 1e12})):
            with pytest.raises(CommandError):
                simulation.step(wrong, dt=0.1)
        found += feature.run(simulation, [step])
    assert not differences.run(found, feature.results)


def test_asking_changes_nothing(feature: Any, differences: Any) -> None:
    """Computing fields, states, checkpoints and derivatives between steps leaves the steps' bits unchanged."""
    simulation, found = feature.simulation(), []
    for index, step in enumerate(feature.way):
        simulation.fields()
        simulation.actuator_states()
        save_state(simulation)
        if index == len(feature.way) // 2:
            with suppress(GdfeError):  # a step that was cut has no derivative
                simulation.jacobian()
                simulation.sensitivities(["positions", "reactions.base"], simulation.parameter_names)
        found += feature.run(simulation, [step])
    assert not differences.run(found, feature.results)


# --- the same with threads ---


@pytest.mark.skipif("PAIRS_IN_THREADS" in os.environ, reason="this is the process that it starts")
def test_with_threads() -> None:
    """All tests of this file pass for a body whose elements two threads divide, in a process that may use two."""
    here = Path(__file__)
    environment = {**os.environ, "NUMBA_NUM_THREADS": "2", "PAIRS_IN_THREADS": "1"}
    options = "-q", "-p", "no:cacheprovider", f"--confcutdir={here.parents[1]}"
    command = [sys.executable, "-m", "pytest", *options, str(here)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=3000, check=False)
    assert done.returncode == 0, done.stdout[-3000:]

# SPDX-License-Identifier: Apache-2.0
"""Threads that divide the elements of a solve give the same bits, also with several solves at a time."""

from __future__ import annotations

import os
import subprocess
import sys
import threading

import numpy as np
import pytest

from gdfe_ros import Simulation, load_scene
from gdfe_ros.solver.minimise import minimiser

SCENES = ["bend5", "three_chamber_arm"]
_CODE = """
import hashlib, sys
from gdfe_ros import Simulation, load_scene
from gdfe_ros.solver.matrix import factor as factors
threads, *names = sys.argv[1:]
for name, coarse in (*((name, factors.Factor.COARSE_FROM) for name in names), ("tensile", 1)):
    factors.Factor.COARSE_FROM = coarse
    scene = load_scene(name, overrides={"solver.threads": int(threads)})
    print(name, *(hashlib.sha256(result.positions.tobytes()).hexdigest() for result in Simulation(scene).play(2)))
"""


def _digests(threads: int) -> dict[str, list[str]]:
    """Solve the scenes in a fresh process with so many threads; return a dict from scene to digests of positions."""
    environment = {**os.environ, "NUMBA_NUM_THREADS": str(threads)}
    command = [sys.executable, "-c", _CODE, str(threads), *SCENES]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=3000, check=True)
    return {name: digests for name, *digests in map(str.split, done.stdout.splitlines())}


def test_every_number_of_threads_gives_the_same_bits() -> None:
    """Three scenes, one of them with a factor in single precision, have the same bits with 1, 2 and 3 threads."""
    one, two, three = (_digests(threads) for threads in (1, 2, 3))
    assert one == two == three
    assert {name: len(digests) for name, digests in one.items()} == dict.fromkeys([*SCENES, "tensile"], 2)


def test_threads_are_used_where_it_pays(monkeypatch: pytest.MonkeyPatch) -> None:
    """With four threads allowed, a body of 157 element blocks uses four, one of 10 blocks only its own thread."""
    counts, descend = [], minimiser.descend
    monkeypatch.setattr(
        minimiser, "descend", lambda problem, *given: counts.append(problem.threads) or descend(problem, *given)
    )
    for cells, expected in (([50, 5, 5], 4), ([20, 2, 2], None)):
        overrides = {"mesh.bar.cells": cells, "solver.threads": 4}
        counts.clear()
        list(Simulation(load_scene("bend5", overrides=overrides)).play(1))
        assert set(counts) == {expected}


def test_solves_at_the_same_time_take_turns() -> None:
    """Two simulations in two threads of a process, each with two numba threads, end with the same bits as alone."""
    scene = load_scene("bend5", overrides={"solver.threads": 2})
    alone = list(Simulation(scene).play(5))[-1].positions
    simulations = [Simulation(scene) for _ in range(2)]
    runs = [threading.Thread(target=lambda each=each: list(each.play(5))) for each in simulations]
    for run in runs:
        run.start()
    for run in runs:
        run.join()
    for simulation in simulations:
        np.testing.assert_array_equal(simulation.positions, alone)

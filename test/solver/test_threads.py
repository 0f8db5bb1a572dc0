# SPDX-License-Identifier: Apache-2.0
"""Threads that divide the elements of a solve give the same bits, also with several solves at a time."""

from __future__ import annotations

import os
import subprocess
import sys

SCENES = ["bend5", "three_chamber_arm"]
_CODE = """
import hashlib, sys
from gdfe_ros import Simulation, load_scene
from gdfe_ros.solver.matrix import constant_matrix as factors
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

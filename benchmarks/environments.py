# SPDX-License-Identifier: Apache-2.0
"""Rate [steps/s] of Gymnasium environments under random actions: alone, in threads, and in processes.

``python -m benchmarks.environments [--out FILE]`` prints the table of docs/benchmark.md. Each run is in a process of
its own with one thread for each environment. Several environments step together, as with `make_vector_env`: each step
waits for the slowest environment. All runs of a scene make
the same two sequences of steps; four environments make each of them twice.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from enum import Enum
from functools import cache
from statistics import fmean
from time import perf_counter
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from benchmarks.markdown import markdown_table
from benchmarks.process import run_module
from benchmarks.replay import figures, summed
from benchmarks.report import run_script
from gdfe_ros.installation import share_dir
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene import load_scene, scene_names
from gdfe_ros.scene.schemas.actuator_schema import ActuatorModel
from gdfe_ros.testing import make_env, make_vector_env
from gdfe_ros.testing.environment import SoftRobotEnv

TOO_LARGE = "measured_arm", "pneunet_finger"
"""Scenes whose steps take so long that a run has only a few: they are left out."""
STEPS, LONGEST = 100, 4.0
"""Number of steps of an environment, and time [s] after which the first environment ends earlier; all others make as
many steps.
"""
PROBED = 5
SEED = 0
_ENDLESS = 10**9


class Way(str, Enum):
    """Method of stepping environments."""

    ALONE = "1"
    THREADS = "2 in threads"
    PROCESSES = "2 in processes"
    FOUR = "4 in processes"


@cache
def explored_scenes() -> tuple[str, ...]:
    """Return the names of the shipped scenes with probes and with actuators that all have ranges, except `TOO_LARGE`.

    Only the entries of the files are read: no mesh is made.
    """
    found = []
    for name in set(scene_names()) - set(TOO_LARGE):
        path = share_dir() / "config" / "scenes" / f"{name}.yaml"
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
        drives = [ActuatorModel(**entry).chosen[1] for entry in data.get("actuators", {}).values()]
        ranges = [getattr(drive, "range", None) or drive.mode.limits for drive in drives]
        if ranges and data.get("probes") and np.isfinite(ranges).all():
            found.append(name)
    return tuple(sorted(found))


def measure(scene: str) -> dict[str, Any]:
    """Run a scene with each method, and return the rates.

    Raises:
        PeerError: a run failed.
    """
    alone = _made(scene, Way.ALONE, STEPS)
    runs = {way: alone if way is Way.ALONE else _made(scene, way, alone["steps"]) for way in Way}
    return {
        "scene": scene,
        "cells": len(load_scene(scene).mesh.cells),
        "rates": {way.value: run["rate"] for way, run in runs.items()},
        **{key: alone[key] for key in ("steps", "converged")},
    }


def _made(scene: str, way: Way, steps: int) -> dict[str, float]:
    """Return the result of `run_way` in a process of its own."""
    request = {"scene": scene, "way": way, "steps": steps}
    return run_module("benchmarks.environments", request, f"{scene}, {way.value}", timeout=600.0)


def environment_table(report: Sequence[dict[str, Any]]) -> str:
    """Return the rates as a Markdown table."""
    rows = [
        (item["scene"], f"{item['cells']}", *(f"{item['rates'][way.value]:.3g}" for way in Way),
         f"{100.0 * item['converged']:.3g}")
        for item in report
    ]  # fmt: skip
    heads = ("scene", "cells", *(f"{way.value}, steps/s" for way in Way), "steps converged [%]")
    return markdown_table(heads, rows)


def run_way(scene: str, way: Way, steps: int) -> dict[str, float]:
    """Make ``steps`` steps of each environment with one method.

    Returns:
        ``rate`` [steps/s] of all environments together, ``steps`` of each environment, and the fraction ``converged``.
    """
    way = Way(way)
    if way is Way.PROCESSES:
        return _in_processes(scene, 2, steps)
    if way is Way.FOUR:
        return _in_processes(scene, 4, steps)
    envs = [_begun(scene, _seed(place)) for place in range(2)]
    if way is Way.ALONE:
        return _alone(*envs, steps)
    with ThreadPoolExecutor(len(envs)) as pool:
        times, converged = _timed(lambda: [result.converged for result in pool.map(_step, envs)], steps)
    return _summary(times, converged)


def _alone(first: SoftRobotEnv, second: SoftRobotEnv, steps: int) -> dict[str, float]:
    """Return the figures of two environments that are stepped one after the other."""
    one, converged = _timed(lambda: [_step(first).converged], steps, LONGEST)
    two, others = _timed(lambda: [_step(second).converged], len(one))
    return _summary(one + two, converged + others) | {"steps": len(one)}


def _in_processes(scene: str, count: int, steps: int) -> dict[str, float]:
    """Return the figures of ``count`` environments in processes, all together."""
    vector = make_vector_env(scene, count, steps=_ENDLESS)
    spaces = [deepcopy(vector.single_action_space) for _ in range(count)]
    for place, space in enumerate(spaces):
        space.seed(_seed(place))

    def sample() -> NDArray[np.float64]:
        return np.array([space.sample() for space in spaces])

    try:
        vector.reset(seed=[_seed(place) for place in range(count)])
        return _summary(*_timed(lambda: vector.step(sample())[4]["converged"], steps))
    finally:
        vector.close()


def _timed(step: Callable[[], Sequence[bool]], steps: int, longest: float = math.inf) -> tuple[list[float], list[bool]]:
    """Make ``steps`` steps after one step to warm up; no step begins after ``longest`` [s].

    ``step`` makes one step of each environment, and returns for each whether the step converged.

    Returns:
        The time [s] of each step, and whether each step of each environment converged.
    """
    times: list[float] = []
    converged: list[bool] = []
    step()
    while len(times) < steps and sum(times) < longest:
        begun = perf_counter()
        converged.extend(step())
        times.append(perf_counter() - begun)
    return times, converged


def _summary(times: Sequence[float], converged: Sequence[bool]) -> dict[str, float]:
    """Return rate, steps and fraction converged from the results of `_timed`."""
    return {"rate": len(converged) / sum(times), "steps": len(times), "converged": fmean(converged)}


def _seed(place: int) -> int:
    """Return the seed of the environment number ``place``: one of two."""
    return SEED + place % 2


def _begun(scene: str, seed: int) -> SoftRobotEnv:
    env = make_env(scene, steps=_ENDLESS)
    env.reset(seed=seed)
    env.action_space.seed(seed)
    return env


def _step(env: SoftRobotEnv) -> StepResult:
    env.step(env.action_space.sample())
    return env.simulation.result


def probe() -> dict[str, float]:
    """Return the figures of the first random steps of every scene."""
    found: dict[str, float] = {}
    for scene in explored_scenes():
        env = _begun(scene, SEED)
        found |= figures(scene, (_step(env) for _ in range(PROBED)), env.simulation)
    return summed(found)


if __name__ == "__main__":
    if sys.argv[1:] and sys.argv[1].startswith("{"):
        print(json.dumps(run_way(**json.loads(sys.argv[1]))))
    else:
        run_script(
            "benchmarks.environments",
            "Environments of Gymnasium.",
            "environments",
            measure=lambda: [measure(scene) for scene in explored_scenes()],
            tables=environment_table,
            probe=probe,
        )

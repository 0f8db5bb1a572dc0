# SPDX-License-Identifier: Apache-2.0
"""Environments of Gymnasium that run in parallel."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from gymnasium.vector import AsyncVectorEnv

from gdfe_ros.testing.environment import make_env
from gdfe_ros.testing.forking import preload

_PRELOAD = "gdfe_ros.testing.preloaded_environment"


def make_vector_env(scene: str | Path, count: int, *, context: str = "forkserver", **options: Any) -> AsyncVectorEnv:
    """Make environments that run in parallel, each in a process of its own.

    Threads of one process could use the same matrix factors, but they would wait for Python's lock between the compiled
    parts of a step. ``python -m benchmarks.environments`` measures threads and processes. By default the processes are
    forked from a server that has imported the package and loaded the kernels once.

    Args:
        scene: name of a scene, or path of a scene file.
        count: number of environments.
        context: start method of the processes. With ``spawn`` each process imports the package. ``fork`` does not work,
            because it copies the threads of the compiler in an invalid state.
        options: keyword arguments of `make_env`.
    """
    if context == "forkserver":
        preload(_PRELOAD)
    return AsyncVectorEnv([partial(make_env, scene, **options)] * count, context=context)

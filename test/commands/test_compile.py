# SPDX-License-Identifier: Apache-2.0
"""``gdfe compile``: after it, no other process compiles the same kernels."""

from __future__ import annotations

import subprocess
import sys

import pytest

from gdfe_ros.cli import main
from gdfe_ros.commands import compile as command
from gdfe_ros.scene import scene_names

_WATCH = """
from numba.core import event
found = event.RecordingListener()
event.register("numba:compile", found)
from gdfe_ros import Simulation, load_scene
simulation = Simulation(load_scene({name!r}))
for _, result in zip(range(3), simulation.play()):
    simulation.fields()
print("compiled", len(found.buffer))
"""


def _compiled_to_play(name: str) -> int:
    done = subprocess.run([sys.executable, "-c", _WATCH.format(name=name)], capture_output=True, text=True, check=True)
    return int(done.stdout.split("compiled")[1])


def test_nothing_is_left_to_compile() -> None:
    """After a scene with contact, motion and a tangent is compiled, another process plays it from the cache."""
    command._compile("finger_press", {})
    assert _compiled_to_play("finger_press") == 0


def test_named_scenes_alone_are_compiled(capsys: pytest.CaptureFixture[str]) -> None:
    """``gdfe compile SCENE`` compiles the kernels of this scene, and names a scene that does not exist."""
    assert main(["compile", "bend5"]) == 0
    assert main(["compile", "nothing"]) == 2
    assert "nothing" in capsys.readouterr().err


def test_the_first_scene_comes_before_all_others() -> None:
    """Every shipped scene is compiled, after one that has what most scenes need."""
    names = [name for name, _ in command.work()]
    assert names[0] == command.FIRST
    assert set(names) == set(scene_names())


def test_what_surfaces_need_is_compiled() -> None:
    """The kernels for surfaces, which no shipped scene uses, are compiled."""
    assert command._compile_surfaces() == "surfaces"

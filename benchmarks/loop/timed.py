# SPDX-License-Identifier: Apache-2.0
"""Rows whose run times are compared: cold bars, streams, robots, motion, contact."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from benchmarks.loop.row import HONEST, Row, Target, Task, limit_ratio
from gdfe_ros.scene import load_scene

SLOWER = 1.05
"""Ratio up to which a row counts as not slower; pairs on a loaded machine scatter by some hundredths."""
STEP = 0.005
"""Time step of motion and of contact [s]."""
LASTS = 0.5
"""Simulated time of a robot in motion [s]."""
BARS = (
    ("bend5", (50, 5, 5), 0.35),
    ("bend5", (30, 3, 3), 0.45),
    ("bend5", (20, 1, 1), 0.35),
    ("bend5", (10, 1, 1), 0.35),
    ("twist90", (20, 5, 5), 0.6),
    ("tensile", (20, 5, 5), 0.6),
    ("twist90_uniform", (12, 3, 3), 0.45),
    ("twist90_uniform", (40, 10, 10), 0.45),
    ("twist90_uniform", (80, 20, 20), 0.45),
)
"""Scene, cells, and the largest ratio of the times of one cold step."""
STREAMS: Mapping[str, tuple[str, int, Mapping[str, Any]]] = {
    "bend5": ("bend5", 200, {}),
    "bend5 10x1x1": ("bend5", 200, {"mesh.bar.cells": [10, 1, 1]}),
    "twist90": ("twist90", 100, {}),
    "tensile": ("tensile", 100, {}),
}
ROBOTS = (
    ("tendon_finger", 400, 100, 0.8),
    ("gripper", 400, 100, 0.55),
    ("three_chamber_arm", 600, 60, 0.55),
    ("bending_tube", 400, 60, 0.65),
    ("pneunet", 400, 40, 0.65),
    ("shape_memory_strip", 400, 100, 0.8),
)
"""Scene, steps of 10 ms of its program, the first ones that are made, and the largest ratio."""
MOTION = {
    "three_chamber_arm": 1.0,
    "swinging_arm": 1.0,
    "tendon_finger": None,
    "gripper": None,
    "shape_memory_strip": None,
    "whip": None,
}
"""Dict from scene to the least simulated time over processor time; None: not slower than before."""
CONTACT: Mapping[str, tuple[float, float, Mapping[str, tuple[float, float]]]] = {
    "grasp": (
        15.0,
        0.005,
        {
            "closes": (0.0, 1.2),
            "lifts": (1.2, 2.2),
            "holds": (2.2, 2.7),
            "puts down": (12.4, 13.4),
            "opens": (13.4, 15.0),
        },
    ),
    "crawler": (2.0, 0.005, {"": (0.0, 1.0)}),
    "finger_press": (4.0, 0.005, {"free": (0.0, 0.25), "presses": (2.0, 2.5)}),
    "soft_pinch": (5.0, 0.005, {"closes": (0.4, 0.9), "lifts": (1.4, 1.9)}),
    "ball_gripper": (4.0, 0.005, {"closes": (0.4, 0.9), "lifts": (1.6, 2.1)}),
}
"""Dict from scene to the duration of its program [s], its step [s], and its phases [s]."""


def make_cold_rows() -> list[Row]:
    """Return the rows with one cold step of a bar."""
    rows = []
    for scene, cells, ratio in BARS:
        task = Task(scene=scene, overrides={"mesh.bar.cells": list(cells)})
        name = f"{scene} {'x'.join(map(str, cells))}, cold"
        times = {"repeats": 1, "turns": 3} if cells[1] > 5 else {"repeats": 5, "turns": 7}
        rows.append(Row(group="cold", name=name, tasks=(task,), **times, errors="each", targets=limit_ratio(ratio)))
    return rows


def make_stream_rows() -> list[Row]:
    """Return the rows with streams of stocky bars: not slower, at errors of at most 0.3."""
    rows = []
    for name, (scene, steps, overrides) in STREAMS.items():
        task = Task(scene=scene, overrides=overrides, total=steps, parts={"": (0, steps)})
        fast = (Target("after", 0.2),) if name == "bend5 10x1x1" else ()
        given = {
            "errors": "path",
            "turns": 11,
            "targets": (*fast, Target("ratio", SLOWER), Target("error", 0.3), *HONEST[1:]),
        }
        rows.append(Row(group="streams", name=f"{name}, {steps} steps", tasks=(task,), **given))
    return rows


def make_robot_rows() -> list[Row]:
    """Return the rows with robots in steps of 10 ms."""
    rows = []
    for scene, total, steps, ratio in ROBOTS:
        task = Task(scene=scene, total=total, parts={"": (0, steps)})
        given = {"errors": "path", "targets": limit_ratio(ratio)}
        rows.append(Row(group="robots", name=f"{scene}, 10 ms", tasks=(task,), **given))
    return rows


def make_motion_rows() -> list[Row]:
    """Return the rows with half a second of motion in steps of 5 ms."""
    rows = []
    for scene, factor in MOTION.items():
        target = Target("ratio", SLOWER) if factor is None else Target("after", factor, least=True)
        targets = target, Target("path over before", 1.1), Target("unconverged", 0)
        given = {"unit": "real time", "errors": "path", "fine": 1e-2, "turns": 5, "targets": targets}
        loaded = load_scene(scene)
        key: dict[str, Any] = {"dynamics.step": STEP} if loaded.dynamics else {"dynamics": {"step": STEP}}
        task = _move(scene, key, loaded.program.duration, STEP, {"": (0.0, LASTS)})
        rows.append(Row(group="motion", name=f"{scene}, motion", tasks=(task,), **given))
    return rows


def make_contact_rows() -> list[Row]:
    """Return the rows with contact: not slower in any phase, and every step converged."""
    given = {"unit": "real time", "turns": 3, "targets": (Target("ratio", SLOWER), Target("unconverged", 0))}
    rows = []
    for scene, (duration, step, phases) in CONTACT.items():
        key = {"dynamics.step": step} if load_scene(scene).dynamics else {}
        task = _move(scene, key, duration, step, phases)
        rows.append(Row(group="contact", name=scene, tasks=(task,), **given))
    return rows


def _move(
    scene: str, key: Mapping[str, Any], duration: float, step: float, phases: Mapping[str, tuple[float, float]]
) -> Task:
    """Return the task of a program of ``duration`` [s] in steps [s], of which those of the ``phases`` [s] are made."""
    parts = {name: tuple(round(end / step) for end in ends) for name, ends in phases.items()}
    return Task(scene=scene, overrides=key, total=round(duration / step), parts=parts)

# SPDX-License-Identifier: Apache-2.0
"""Thin bodies of soft robots in statics, as scenes and commands: membranes, tubes, strips, flexures, pads, sheets."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from benchmarks.loop.row import Task

SILICONE = {"law": "neo_hookean", "young": 6e5, "poisson": 0.45, "density": 1080}
THIN = Path(__file__).with_name("thin_bodies.yaml")
"""Scenes of thin bodies."""
AIR = {"air": {"chamber": {"command": "pressure"}}}
MILLIMETRE = 1e-3
Scene = dict[str, Any]
Commands = list[dict[str, Any]]


def mesh_bar(length: float, width: float, height: float, cells: Sequence[int], **options: Any) -> Scene:
    """Return the mesh of a bar; sizes in mm."""
    size = [extent * MILLIMETRE for extent in (length, width, height)]
    return {"bar": {"size": size, "cells": list(cells), **options}}


def select_box(**ranges: Sequence[float]) -> Scene:
    """Return a box as a place; ranges in mm."""
    return {"box": {axis: [end * MILLIMETRE for end in ends] for axis, ends in ranges.items()}}


def fix(where: Mapping[str, Any]) -> Scene:
    """Return a fixed handle."""
    return {"where": dict(where), "fixed": True}


def hold_ends() -> Scene:
    """Return two handles: the left one fixed, the right one movable."""
    return {"left": fix({"face": "x-"}), "right": {"where": {"face": "x+"}}}


def fix_rim() -> Scene:
    """Return a handle that holds a plate all round."""
    return {"rim": fix({"any": [{"face": face} for face in ("x-", "x+", "y-", "y+")]})}


def command_handle(name: str, poses: Sequence[Sequence[float]]) -> Commands:
    """Return the commands of a handle; a pose is x, y, z [mm], and perhaps an angle about x [rad]."""
    found = []
    for pose in poses:
        x, y, z, angle = (*pose, 0.0)[:4]
        shift = [x * MILLIMETRE, y * MILLIMETRE, z * MILLIMETRE]
        found.append({"handles": {name: [shift, [angle, 0.0, 0.0]]}})
    return found


def command_load(name: str, values: Sequence[float]) -> Commands:
    """Return the commands of a load."""
    return [{"loads": {name: value}} for value in values]


def command_actuator(name: str, values: Sequence[float]) -> Commands:
    """Return the commands of an actuator."""
    return [{"actuators": {name: value}} for value in values]


def divide(last: float, count: int) -> list[float]:
    """Return ``count`` equal steps from 0, without 0, to ``last``."""
    return [float(value) for value in np.linspace(0.0, last, count + 1)[1:]]


def describe_scene(name: str, mesh: Scene, handles: Scene, material: Scene = SILICONE, **more: Any) -> Scene:
    """Return a scene of one material."""
    return {
        "name": name,
        "mesh": mesh,
        "materials": {"m": material},
        "regions": [{"material": "m"}],
        "handles": handles,
        **more,
    }


def make_task(given: Scene, commands: Commands, **options: Any) -> Task:
    """Return the task of a scene with the commands of its steps."""
    return Task(text=json.dumps(given), commands=commands, **options)


def press(face: str) -> Scene:
    """Return a load ``p``: a dead traction of 1 Pa along z on a face."""
    return {"p": {"surface": {"where": {"face": face}, "traction": [0, 0, 1]}}}


def make_thin_bodies() -> list[Task]:
    """Return the tasks of the thin bodies: the programs of `THIN`, a step a second."""
    tasks = []
    for text in THIN.read_text(encoding="utf-8").split("---\n"):
        scene = yaml.safe_load(text)
        steps = scene["program"]["duration"]
        tasks.append(Task(text=text, total=steps, parts={"": (0, steps)}, label=scene["name"]))
    return tasks

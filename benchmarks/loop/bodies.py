# SPDX-License-Identifier: Apache-2.0
"""Thin bodies of soft robots in statics, as scenes and commands: membranes, tubes, strips, flexures, pads, sheets."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.loop.row import Task

SILICONE = {"law": "neo_hookean", "young": 6e5, "poisson": 0.45, "density": 1080}
SOFT = {"law": "neo_hookean", "young": 1.2e5, "poisson": 0.45, "density": 1070}
POLYURETHANE = {"law": "neo_hookean", "young": 1.2e7, "poisson": 0.40, "density": 1200}
FABRIC = {"law": "linear", "young": 5e7, "poisson": 0.3, "density": 900}
WEIGHT = {"weight": {"gravity": [0, 0, -9.81]}}
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


def fix_ends() -> Scene:
    """Return two fixed handles."""
    return {"left": fix({"face": "x-"}), "right": fix({"face": "x+"})}


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


def lift(last: float, count: int) -> list[tuple[float, ...]]:
    """Return poses that rise along z to ``last`` [mm]."""
    return [(0.0, 0.0, z) for z in divide(last, count)]


def shorten(last: float, count: int) -> list[tuple[float, ...]]:
    """Return poses that move against x by up to ``last`` [mm]."""
    return [(-x, 0.0, 0.0) for x in divide(last, count)]


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


def make_membranes() -> dict[str, Task]:
    """Return membranes that are held all round under a load, and the thin wall of a bladder."""
    found = {}
    for name, cells in (("membrane", [20, 20, 1]), ("membrane, 2 cells", [20, 20, 2])):
        given = describe_scene("membrane", mesh_bar(60, 60, 1, cells), fix_rim(), loads=press("z-"))
        found[name] = make_task(given, command_load("p", divide(3000.0, 10)))
    cut = [select_box(x=(5, 55), y=(-15, 15), z=(-4, 4))]
    mesh = mesh_bar(60, 40, 12, [24, 16, 6], cut=cut)
    given = describe_scene("bladder", mesh, {"base": fix({"face": "z-"})}, actuators=AIR)
    return found | {"bladder": make_task(given, command_actuator("air", divide(2e4, 10)))}


def make_bellows() -> dict[str, Task]:
    """Return a bellows that is inflated, and one that is shortened."""
    cut = []
    for k in range(5):
        x = 4 + k * 10
        cut.append(select_box(x=(x, x + 4), y=(-12, 12), z=(-12, 12)))
        if k < 4:
            cut.append(select_box(x=(x + 4, x + 10), y=(-8, 8), z=(-8, 8)))
    for k in range(4):
        x = 10 + k * 10
        for side in ((-20, -10), (10, 20)):
            cut.append(select_box(x=(x, x + 2), y=side, z=(-20, 20)))
            cut.append(select_box(x=(x, x + 2), y=(-20, 20), z=side))
    mesh = mesh_bar(52, 28, 28, [26, 14, 14], cut=cut)
    free = describe_scene("bellows", mesh, {"base": fix({"face": "x-"})}, actuators=AIR, loads=WEIGHT)
    held = describe_scene("bellows", mesh, hold_ends(), actuators=AIR)
    return {
        "bellows": make_task(free, command_actuator("air", divide(1.5e4, 8))),
        "bellows, held": make_task(held, command_handle("right", shorten(6.0, 8))),
    }


def make_tubes() -> dict[str, Task]:
    """Return thin-walled tubes that are shortened, bent, inflated and under vacuum."""
    open_, cells = {"inner": 0.009, "outer": 0.010, "length": 0.08, "cells": [1, 20, 24]}, {"cap": 0.004}
    held = describe_scene("tube", {"tube": open_}, hold_ends())
    closed = describe_scene("tube", {"tube": {**open_, **cells}}, fix_ends(), actuators=AIR)
    return {
        "tube, shortened": make_task(held, command_handle("right", shorten(4.0, 8))),
        "tube, bent": make_task(held, command_handle("right", lift(16.0, 8))),
        "tube, inflated": make_task(closed, command_actuator("air", divide(1.2e4, 8))),
        "tube, vacuum": make_task(closed, command_actuator("air", divide(-4e3, 8))),
    }


def make_sheets() -> dict[str, Task]:
    """Return sheets of two layers of which one grows, a stiff layer on a soft body, fibres, and a hammock."""
    growth = {"g": {"growth": {"stretch": [1.06, 1.0, 1.0], "where": select_box(z=(0, 1))}}}
    mesh, grown = mesh_bar(80, 40, 1.0, [24, 12, 2]), command_actuator("g", divide(1.0, 10))
    held = describe_scene("sheet", mesh, hold_ends(), actuators=growth)
    free = describe_scene("sheet", mesh, {"left": fix({"face": "x-"})}, actuators=growth, loads=WEIGHT)
    fabric = describe_scene("fabric", mesh_bar(100, 30, 5, [30, 9, 5]), hold_ends(), SOFT, loads=WEIGHT)
    fabric["materials"]["f"] = FABRIC
    fabric["regions"] = [{"material": "m"}, {"material": "f", "where": select_box(z=(-2.5, -1.5))}]
    threads = {"f": {"where": {"face": "z-"}, "along": [1, 0, 0], "angles_deg": [0, 90], "stiffness": 500.0}}
    fibres = describe_scene(
        "fibres", mesh_bar(100, 60, 0.8, [25, 15, 1]), hold_ends(), SOFT, fibres=threads, loads=WEIGHT
    )
    pulled = [(1.0, 0.0, 0.0), *((1.0, 0.0, z) for z in divide(15.0, 8))]
    hung = describe_scene("hammock", mesh_bar(150, 50, 1, [40, 14, 1]), hold_ends(), loads=WEIGHT)
    return {
        "sheet grows, held": make_task(held, grown),
        "sheet grows, free": make_task(free, grown),
        "fabric on soft body": make_task(fabric, command_handle("right", lift(15.0, 8))),
        "sheet of fibres": make_task(fibres, command_handle("right", pulled)),
        "hammock": make_task(hung, [*command_load("weight", [1.0]), *command_handle("right", shorten(20.0, 10))]),
    }


def make_strips() -> dict[str, Task]:
    """Return thin strips that are held at both ends and lifted, shortened, twisted or pressed."""
    thin, thick = mesh_bar(120, 15, 1, [40, 5, 1]), mesh_bar(120, 15, 1.5, [40, 5, 1])
    twice = mesh_bar(120, 15, 1.5, [40, 5, 2])
    push = {"f": {"surface": {"where": select_box(x=(-1, 500), z=(0.74, 0.76)), "force": [0, 0, -1]}}}
    pull = {"f": {"surface": {"where": {"face": "x+"}, "force": [0, 0, -1]}}}
    leaf = mesh_bar(60, 10, 12, [30, 5, 12], cut=[select_box(x=(6, 54), y=(-20, 20), z=(-5, 5))])
    lifted = describe_scene("strip", mesh_bar(200, 20, 1, [40, 4, 1]), hold_ends(), SOFT)
    twist = command_handle("right", [(0.0, 0.0, 0.0, angle) for angle in divide(3.0, 12)])
    shorter = command_handle("right", shorten(12.0, 12))
    free = {"left": fix({"face": "x-"})}
    return {
        "strip, lifted": make_task(lifted, command_handle("right", lift(20.0, 10))),
        "strip, shortened": make_task(describe_scene("strip", thin, hold_ends(), POLYURETHANE, loads=WEIGHT), shorter),
        "strip of 2 cells, shortened": make_task(describe_scene("strip", twice, hold_ends(), loads=WEIGHT), shorter),
        "strip, twisted": make_task(describe_scene("strip", thin, hold_ends()), twist),
        "strip, pressed": make_task(
            describe_scene("strip", thick, fix_ends(), loads=push), command_load("f", divide(0.4, 10))
        ),
        "flexure": make_task(
            describe_scene("flexure", mesh_bar(60, 10, 0.8, [30, 5, 1]), hold_ends(), POLYURETHANE),
            command_handle("right", lift(6.0, 10)),
        ),
        "cantilever": make_task(
            describe_scene("strip", mesh_bar(100, 15, 1, [40, 6, 1]), free, loads=pull),
            command_load("f", divide(0.02, 8)),
        ),
        "parallel flexure": make_task(
            describe_scene("flexure", leaf, hold_ends(), POLYURETHANE), command_handle("right", lift(10.0, 10))
        ),
    }


def make_pads() -> dict[str, Task]:
    """Return thin pads into which a ball is pressed."""
    found = {}
    for name, mesh, handles, place, depth in (
        ("pad, held at its ends", mesh_bar(40, 20, 1.5, [20, 10, 1]), fix_ends(), [0.02, 0, 0.0058], 6.0),
        ("pad, held all round", mesh_bar(30, 30, 1, [15, 15, 1]), fix_rim(), [0.015, 0, 0.0055], 5.0),
    ):
        ball = {"ball": {"sphere": {"radius": 0.005}, "at": place}}
        given = describe_scene("pad", mesh, handles, obstacles=ball)
        found[name] = make_task(given, command_handle("ball", lift(-depth, 10)))
    return found


FAMILIES: tuple[Callable[[], dict[str, Task]], ...] = (
    make_strips,
    make_membranes,
    make_bellows,
    make_tubes,
    make_sheets,
    make_pads,
)


def make_thin_bodies() -> dict[str, Task]:
    """Return all thin bodies."""
    return {name: replace(each, label=name) for family in FAMILIES for name, each in family().items()}

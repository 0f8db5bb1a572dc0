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


def bar(length: float, width: float, height: float, cells: Sequence[int], **options: Any) -> Scene:
    """Return the mesh of a bar; sizes in mm."""
    size = [extent * MILLIMETRE for extent in (length, width, height)]
    return {"bar": {"size": size, "cells": list(cells), **options}}


def box(**ranges: Sequence[float]) -> Scene:
    """Return a box as a place; ranges in mm."""
    return {"box": {axis: [end * MILLIMETRE for end in ends] for axis, ends in ranges.items()}}


def fixed(where: Mapping[str, Any]) -> Scene:
    """Return a fixed handle."""
    return {"where": dict(where), "fixed": True}


def ends() -> Scene:
    """Return two handles: the left one fixed, the right one movable."""
    return {"left": fixed({"face": "x-"}), "right": {"where": {"face": "x+"}}}


def both() -> Scene:
    """Return two fixed handles."""
    return {"left": fixed({"face": "x-"}), "right": fixed({"face": "x+"})}


def rim() -> Scene:
    """Return a handle that holds a plate all round."""
    return {"rim": fixed({"any": [{"face": face} for face in ("x-", "x+", "y-", "y+")]})}


def moves(name: str, poses: Sequence[Sequence[float]]) -> Commands:
    """Return the commands of a handle; a pose is x, y, z [mm], and perhaps an angle about x [rad]."""
    found = []
    for pose in poses:
        x, y, z, angle = (*pose, 0.0)[:4]
        shift = [x * MILLIMETRE, y * MILLIMETRE, z * MILLIMETRE]
        found.append({"handles": {name: [shift, [angle, 0.0, 0.0]]}})
    return found


def loads(name: str, values: Sequence[float]) -> Commands:
    """Return the commands of a load."""
    return [{"loads": {name: value}} for value in values]


def pulls(name: str, values: Sequence[float]) -> Commands:
    """Return the commands of an actuator."""
    return [{"actuators": {name: value}} for value in values]


def rising(last: float, count: int) -> list[float]:
    """Return ``count`` equal steps from 0, without 0, to ``last``."""
    return [float(value) for value in np.linspace(0.0, last, count + 1)[1:]]


def lifts(last: float, count: int) -> list[tuple[float, ...]]:
    """Return poses that rise along z to ``last`` [mm]."""
    return [(0.0, 0.0, z) for z in rising(last, count)]


def shortens(last: float, count: int) -> list[tuple[float, ...]]:
    """Return poses that move against x by up to ``last`` [mm]."""
    return [(-x, 0.0, 0.0) for x in rising(last, count)]


def scene(name: str, mesh: Scene, handles: Scene, material: Scene = SILICONE, **more: Any) -> Scene:
    """Return a scene of one material."""
    return {
        "name": name,
        "mesh": mesh,
        "materials": {"m": material},
        "regions": [{"material": "m"}],
        "handles": handles,
        **more,
    }


def task(given: Scene, commands: Commands, **options: Any) -> Task:
    """Return the task of a scene with the commands of its steps."""
    return Task(text=json.dumps(given), commands=commands, **options)


def pressed(face: str) -> Scene:
    """Return a load ``p``: a dead traction of 1 Pa along z on a face."""
    return {"p": {"surface": {"where": {"face": face}, "traction": [0, 0, 1]}}}


def membranes() -> dict[str, Task]:
    """Return membranes that are held all round under a load, and the thin wall of a bladder."""
    found = {}
    for name, cells in (("membrane", [20, 20, 1]), ("membrane, 2 cells", [20, 20, 2])):
        given = scene("membrane", bar(60, 60, 1, cells), rim(), loads=pressed("z-"))
        found[name] = task(given, loads("p", rising(3000.0, 10)))
    cut = [box(x=(5, 55), y=(-15, 15), z=(-4, 4))]
    mesh = bar(60, 40, 12, [24, 16, 6], cut=cut)
    given = scene("bladder", mesh, {"base": fixed({"face": "z-"})}, actuators=AIR)
    return found | {"bladder": task(given, pulls("air", rising(2e4, 10)))}


def bellows() -> dict[str, Task]:
    """Return a bellows that is inflated, and one that is shortened."""
    cut = []
    for k in range(5):
        x = 4 + k * 10
        cut.append(box(x=(x, x + 4), y=(-12, 12), z=(-12, 12)))
        if k < 4:
            cut.append(box(x=(x + 4, x + 10), y=(-8, 8), z=(-8, 8)))
    for k in range(4):
        x = 10 + k * 10
        for side in ((-20, -10), (10, 20)):
            cut.append(box(x=(x, x + 2), y=side, z=(-20, 20)))
            cut.append(box(x=(x, x + 2), y=(-20, 20), z=side))
    mesh = bar(52, 28, 28, [26, 14, 14], cut=cut)
    free = scene("bellows", mesh, {"base": fixed({"face": "x-"})}, actuators=AIR, loads=WEIGHT)
    held = scene("bellows", mesh, ends(), actuators=AIR)
    return {
        "bellows": task(free, pulls("air", rising(1.5e4, 8))),
        "bellows, held": task(held, moves("right", shortens(6.0, 8))),
    }


def tubes() -> dict[str, Task]:
    """Return thin-walled tubes that are shortened, bent, inflated and under vacuum."""
    open_, cells = {"inner": 0.009, "outer": 0.010, "length": 0.08, "cells": [1, 20, 24]}, {"cap": 0.004}
    held = scene("tube", {"tube": open_}, ends())
    closed = scene("tube", {"tube": {**open_, **cells}}, both(), actuators=AIR)
    return {
        "tube, shortened": task(held, moves("right", shortens(4.0, 8))),
        "tube, bent": task(held, moves("right", lifts(16.0, 8))),
        "tube, inflated": task(closed, pulls("air", rising(1.2e4, 8))),
        "tube, vacuum": task(closed, pulls("air", rising(-4e3, 8))),
    }


def sheets() -> dict[str, Task]:
    """Return sheets of two layers of which one grows, a stiff layer on a soft body, fibres, and a hammock."""
    growth = {"g": {"growth": {"stretch": [1.06, 1.0, 1.0], "where": box(z=(0, 1))}}}
    mesh, grown = bar(80, 40, 1.0, [24, 12, 2]), pulls("g", rising(1.0, 10))
    held = scene("sheet", mesh, ends(), actuators=growth)
    free = scene("sheet", mesh, {"left": fixed({"face": "x-"})}, actuators=growth, loads=WEIGHT)
    fabric = scene("fabric", bar(100, 30, 5, [30, 9, 5]), ends(), SOFT, loads=WEIGHT)
    fabric["materials"]["f"] = FABRIC
    fabric["regions"] = [{"material": "m"}, {"material": "f", "where": box(z=(-2.5, -1.5))}]
    threads = {"f": {"where": {"face": "z-"}, "along": [1, 0, 0], "angles_deg": [0, 90], "stiffness": 500.0}}
    fibres = scene("fibres", bar(100, 60, 0.8, [25, 15, 1]), ends(), SOFT, fibres=threads, loads=WEIGHT)
    pulled = [(1.0, 0.0, 0.0), *((1.0, 0.0, z) for z in rising(15.0, 8))]
    hung = scene("hammock", bar(150, 50, 1, [40, 14, 1]), ends(), loads=WEIGHT)
    return {
        "sheet grows, held": task(held, grown),
        "sheet grows, free": task(free, grown),
        "fabric on soft body": task(fabric, moves("right", lifts(15.0, 8))),
        "sheet of fibres": task(fibres, moves("right", pulled)),
        "hammock": task(hung, [*loads("weight", [1.0]), *moves("right", shortens(20.0, 10))]),
    }


def strips() -> dict[str, Task]:
    """Return thin strips that are held at both ends and lifted, shortened, twisted or pressed."""
    thin, thick = bar(120, 15, 1, [40, 5, 1]), bar(120, 15, 1.5, [40, 5, 1])
    twice = bar(120, 15, 1.5, [40, 5, 2])
    push = {"f": {"surface": {"where": box(x=(-1, 500), z=(0.74, 0.76)), "force": [0, 0, -1]}}}
    pull = {"f": {"surface": {"where": {"face": "x+"}, "force": [0, 0, -1]}}}
    leaf = bar(60, 10, 12, [30, 5, 12], cut=[box(x=(6, 54), y=(-20, 20), z=(-5, 5))])
    lifted = scene("strip", bar(200, 20, 1, [40, 4, 1]), ends(), SOFT)
    twist = moves("right", [(0.0, 0.0, 0.0, angle) for angle in rising(3.0, 12)])
    shorter = moves("right", shortens(12.0, 12))
    free = {"left": fixed({"face": "x-"})}
    return {
        "strip, lifted": task(lifted, moves("right", lifts(20.0, 10))),
        "strip, shortened": task(scene("strip", thin, ends(), POLYURETHANE, loads=WEIGHT), shorter),
        "strip of 2 cells, shortened": task(scene("strip", twice, ends(), loads=WEIGHT), shorter),
        "strip, twisted": task(scene("strip", thin, ends()), twist),
        "strip, pressed": task(scene("strip", thick, both(), loads=push), loads("f", rising(0.4, 10))),
        "flexure": task(
            scene("flexure", bar(60, 10, 0.8, [30, 5, 1]), ends(), POLYURETHANE), moves("right", lifts(6.0, 10))
        ),
        "cantilever": task(scene("strip", bar(100, 15, 1, [40, 6, 1]), free, loads=pull), loads("f", rising(0.02, 8))),
        "parallel flexure": task(scene("flexure", leaf, ends(), POLYURETHANE), moves("right", lifts(10.0, 10))),
    }


def pads() -> dict[str, Task]:
    """Return thin pads into which a ball is pressed."""
    found = {}
    for name, mesh, handles, place, depth in (
        ("pad, held at its ends", bar(40, 20, 1.5, [20, 10, 1]), both(), [0.02, 0, 0.0058], 6.0),
        ("pad, held all round", bar(30, 30, 1, [15, 15, 1]), rim(), [0.015, 0, 0.0055], 5.0),
    ):
        ball = {"ball": {"sphere": {"radius": 0.005}, "at": place}}
        given = scene("pad", mesh, handles, obstacles=ball)
        found[name] = task(given, moves("ball", lifts(-depth, 10)))
    return found


FAMILIES: tuple[Callable[[], dict[str, Task]], ...] = (strips, membranes, bellows, tubes, sheets, pads)


def thin_bodies() -> dict[str, Task]:
    """Return all thin bodies."""
    return {name: replace(each, label=name) for family in FAMILIES for name, each in family().items()}

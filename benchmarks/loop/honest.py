# SPDX-License-Identifier: Apache-2.0
"""Rows of true errors: far steps, tendons, strips, plates, membranes, columns, tubes, and 24 thin bodies."""

from __future__ import annotations

from functools import partial
from itertools import product

import numpy as np

from benchmarks.loop import bodies
from benchmarks.loop.row import STABLE, Row, Target, Task
from benchmarks.torture.honesty import RUBBER, TOLERANCES, bar, held, tendon_bar
from gdfe_ros.scene import Scene

FINE = 1e-4
"""Fine tolerance, divided by the tolerance."""
SLOW = {"max_iterations": 20000}
"""Settings of strips, whose far steps take many iterations."""
BENT = 0.01
"""Displacement of a column across its axis, divided by its length, from which it counts as bent."""
YOUNG, LENGTH, THICKNESS = 1e6, 0.2, 0.004
"""Young's modulus [Pa], length and thickness [m] of the columns."""
LOADS = np.linspace(1.16, 2.5, 34)
"""Loads of the columns, in Euler loads."""
FASTER = 0.1
"""Largest processor time of all solves of the thin bodies, finer ones included, over that of before."""
SEEDS, BARS = (1, 2), 40
"""Seeds of the stocky bars, and number of bars of a seed."""
TENDONS = {
    "ratio": (10.0, 20.0, 40.0),
    "cells": ((20, 1, 1), (30, 2, 2)),
    "law": (RUBBER.replace("0.499", "0.45"), RUBBER, "preset: dragon_skin_30"),
    "command": (("shortening", 0.3), ("shortening", 1.0), ("tension", 0.02)),
    "steps": (3, 10),
}
"""Length over thickness, cells, law, final command and number of steps of bars that a tendon bends."""


def make_far_row() -> Row:
    """Return the row of stocky bars after a far step, at the tolerances of the torture test."""
    tasks = []
    for seed in SEEDS:
        random = np.random.default_rng(seed)
        for scene in [make_random_bar(random) for _ in range(BARS)]:
            command = [] if scene.program else [{"loads": {"weight": 1.0}}]
            tasks += [Task(text=scene.source, tolerance=tolerance, commands=command) for tolerance in TOLERANCES]
    return _make_row("far steps of stocky bars", tasks)


def make_random_bar(random: np.random.Generator) -> Scene:
    """Return a bar 1.5 to 9 times as long as thick; it sags far under its weight, or both ends are held and moved."""
    ratio, across = float(random.uniform(1.5, 9.0)), int(random.integers(2, 4))
    cells = max(2, round(ratio * across * random.uniform(0.6, 1.0))), across, across
    length, poisson = 0.01 * ratio, float(random.choice([0.3, 0.45, 0.49]))
    shift, turn = random.uniform(-0.25, 0.25, 3).tolist(), random.uniform(-90.0, 90.0, 3).tolist()
    sag, sags = 10.0 ** random.uniform(-2.0, 0.0), random.random() < 0.4
    return bar((length, 0.01, 0.01), cells, sag, poisson=poisson) if sags else held(length, cells, poisson, shift, turn)


def make_tendon_row() -> Row:
    """Return the row of slender bars that a tendon bends."""
    tasks = []
    for ratio, cells, law, command, steps in product(*TENDONS.values()):
        scene = tendon_bar(ratio, cells, law, *command)
        tasks.append(Task(text=scene.source, total=steps, parts={"": (0, steps)}, limit=30.0))
    return _make_row("slender bars with tendons", tasks)


def make_strip_row() -> Row:
    """Return the row of thin strips that are held at both ends, after far commands at random."""
    random, tasks = np.random.default_rng(4), []
    shapes = [([0.2, 0.02, 0.001], [40, 4, 1])]
    for _ in range(9):
        size = [float(random.uniform(*ends)) for ends in ((0.1, 0.3), (0.01, 0.06), (0.0007, 0.003))]
        shapes.append((size, [int(random.integers(20, 45)), int(random.integers(2, 6)), 1]))
    for size, cells in shapes:
        commands = []
        for _ in range(4):
            shift = random.uniform([-0.25, -0.1, -0.1], [0.02, 0.1, 0.1]) * size[0]
            commands.append({"handles": {"right": [shift.tolist(), random.uniform(-0.6, 0.6, 3).tolist()]}})
        commands.append({"handles": {"right": [[0.0] * 3, [0.0] * 3]}})
        mesh, rubber = {"bar": {"size": size, "cells": cells}}, {"law": "neo_hookean", "young": 1e6, "poisson": 0.45}
        given = bodies.describe_scene("strip", mesh, bodies.hold_ends(), rubber, solver=SLOW)
        tasks.append(bodies.make_task(given, commands, limit=90.0))
    return _make_row("thin strips held at both ends, far steps", tasks)


def make_plate_row() -> Row:
    """Return the row of plates that are held all round, and pressed, sheared or wrinkled in one step or in four."""
    tasks = []
    for length, thickness, cells, last in (
        (60, 1.0, 20, 3e3),
        (60, 0.5, 20, 1e3),
        (100, 2.0, 25, 1e4),
        (40, 3.0, 12, 1e5),
    ):
        mesh = bodies.mesh_bar(length, length, thickness, [cells, cells, 1])
        given = bodies.describe_scene("plate", mesh, bodies.fix_rim(), loads=bodies.press("z-"))
        for count in (1, 4):
            tasks.append(bodies.make_task(given, bodies.command_load("p", bodies.divide(last, count)), limit=30.0))
    edge = {"box": {"x": [0.0, 0.055], "y": [-0.03, -0.0299]}}
    sides = {"left": bodies.fix({"any": [{"face": "x-"}, edge]}), "right": {"where": {"face": "x+"}}}
    for shift in ((0.0, 6.0, 0.0), (-3.0, 0.0, 0.0), (0.0, 0.0, 12.0)):
        given = bodies.describe_scene("plate", bodies.mesh_bar(60, 60, 1.0, [20, 20, 1]), sides)
        tasks.append(bodies.make_task(given, bodies.command_handle("right", [shift]), limit=30.0))
    return _make_row("plates held all round or on three sides", tasks)


def make_membrane_row() -> Row:
    """Return the row of thin membranes over a chamber: far steps of the pressure up to a dome, down, and up again."""
    tasks, cut = [], [bodies.select_box(x=(4, 56), y=(-26, 26), z=(-5, 5))]
    for thickness, cells, last in ((1.0, 12, 4e3), (1.0, 12, 1.2e4)):
        mesh = bodies.mesh_bar(60, 60, 10 + 2 * thickness, [30, 30, cells], cut=cut)
        given = bodies.describe_scene("membrane", mesh, {"base": bodies.fix({"face": "z-"})}, actuators=bodies.AIR)
        tasks.append(
            bodies.make_task(given, bodies.command_actuator("air", [last, 0.25 * last, last, 0.0]), limit=60.0)
        )
    return _make_row("membranes over a chamber, far steps", tasks)


def make_column_row(width: float = 1.0) -> Row:
    """Return the row of straight columns under 1.16 to 2.5 Euler loads in one step: all have to end bent.

    A square column may bend in any direction, and its energy hardly depends on it: the way to its minimum is long.

    Args:
        width: width of the section, divided by its thickness.
    """
    tasks, wide = [], width * THICKNESS
    euler = np.pi**2 * YOUNG * wide * THICKNESS**3 / 12.0 / (4.0 * LENGTH**2)
    for factor in LOADS:
        push = {"push": {"surface": {"where": {"face": "x+"}, "force": [-float(euler * factor), 0, 0]}}}
        mesh = {"bar": {"size": [LENGTH, wide, THICKNESS], "cells": [20, 1, 1]}}
        rubber = {"law": "neo_hookean", "young": YOUNG, "poisson": 0.3}
        given = bodies.describe_scene("column", mesh, {"base": bodies.fix({"face": "x-"})}, rubber, loads=push)
        tasks.append(bodies.make_task(given, bodies.command_load("push", [1.0])))
    targets = Target("bent", len(LOADS), least=True), Target("silent", 0), *STABLE
    section = "square" if width == 1.0 else f"{width:g} times as wide as thick"
    return _make_row(f"columns beyond their Euler load, {section}", tasks, bends=BENT, targets=targets)


def make_tube_row() -> Row:
    """Return the row of thin capped tubes under vacuum: they have to collapse, as their tangent says."""
    rubber, tasks = {"law": "neo_hookean", "young": 1e6, "poisson": 0.45}, []
    air = {"air": {"chamber": {"range": [-5000, 5000]}}}
    for cells, cap in (([1, 24, 12], 0.002), ([1, 20, 24], 0.004)):
        tube = {"tube": {"inner": 0.009, "outer": 0.010, "length": 0.08, "cells": cells, "cap": cap}}
        given = bodies.describe_scene("tube", tube, {"base": bodies.fix({"face": "x-"})}, rubber, actuators=air)
        tasks.append(bodies.make_task(given, bodies.command_actuator("air", [-1e3, -2e3, -3e3]), limit=60.0))
        tasks.append(bodies.make_task(given, bodies.command_actuator("air", [-3e3]), limit=60.0))
    return _make_row("thin tubes under vacuum", tasks)


def make_body_row() -> Row:
    """Return the row of all thin bodies together; processor time of their steps, and of the whole row."""
    targets = Target("whole over before", FASTER), *STABLE
    return _make_row("24 thin bodies", bodies.make_thin_bodies(), push=True, fine=1e-5, targets=targets)


def _make_row(name: str, tasks: list[Task], **options: object) -> Row:
    given = {"group": "errors", "unit": "s", "errors": "each", "fine": FINE, "targets": STABLE, **options}
    return Row(name=name, tasks=tuple(tasks), **given)


def make_error_rows() -> list[Row]:
    """Return all rows of true errors."""
    return [
        make()
        for make in (
            make_far_row,
            make_tendon_row,
            make_strip_row,
            make_plate_row,
            make_membrane_row,
            make_column_row,
            partial(make_column_row, 1.25),
            make_tube_row,
            make_body_row,
        )
    ]

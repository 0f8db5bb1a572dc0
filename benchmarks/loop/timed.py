# SPDX-License-Identifier: Apache-2.0
"""Rows whose run times are compared: cold bars, streams, robots, motion, contact."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from benchmarks.loop.row import HONEST, Row, Target, Task, limit_ratio
from benchmarks.provenance import ROOT
from gdfe_ros.scene import load_scene

GROUPS: dict[str, list[dict[str, Any]]] = yaml.safe_load(Path(__file__).with_name("timed.yaml").read_text("utf-8"))
"""What is played in the rows of each group, and what is to be reached."""
SLOWER = 1.05
"""Ratio up to which a row counts as not slower; pairs on a loaded machine scatter by some hundredths."""
STEP = 0.005
"""Time step of motion and of contact [s]."""
LASTS = 0.5
"""Simulated time of a robot in motion [s]."""


def _mesh(given: Mapping[str, Any]) -> dict[str, list[int]]:
    """Return the override of a bar's cells; empty for those of the scene."""
    return {"mesh.bar.cells": [int(count) for count in given["cells"].split("x")]} if "cells" in given else {}


def make_cold_rows() -> list[Row]:
    """Return the rows with one cold step of a bar."""
    rows = []
    for given in GROUPS["cold"]:
        task = Task(scene=given["scene"], overrides=_mesh(given))
        counts = {"repeats": given.get("repeats", 5), "turns": given.get("turns", 7)}
        more = {"errors": "each", "targets": limit_ratio(given["ratio"])}
        rows.append(Row(group="cold", name=f"{given['scene']} {given['cells']}, cold", tasks=(task,), **counts, **more))
    return rows


def make_stream_rows() -> list[Row]:
    """Return the rows with streams of stocky bars: not slower, at errors of at most 0.3."""
    rows = []
    for given in GROUPS["streams"]:
        steps = given["steps"]
        task = Task(scene=given["scene"], overrides=_mesh(given), total=steps, parts={"": (0, steps)})
        fast = [Target("after", given["longest"])] if "longest" in given else []
        targets = (*fast, Target("ratio", SLOWER), Target("error", 0.3), *HONEST[1:])
        name = f"{' '.join([given['scene'], *filter(None, [given.get('cells')])])}, {steps} steps"
        rows.append(Row(group="streams", name=name, tasks=(task,), errors="path", turns=11, targets=targets))
    return rows


def make_robot_rows() -> list[Row]:
    """Return the rows with robots in steps of 10 ms."""
    rows = []
    for given in GROUPS["robots"]:
        task = Task(scene=given["scene"], total=given["total"], parts={"": (0, given["steps"])})
        more = {"errors": "path", "targets": limit_ratio(given["ratio"])}
        rows.append(Row(group="robots", name=f"{given['scene']}, 10 ms", tasks=(task,), **more))
    return rows


def make_motion_rows() -> list[Row]:
    """Return the rows with half a second of motion in steps of 5 ms."""
    rows = []
    for given in GROUPS["motion"]:
        scene = load_scene(given["scene"])
        target = Target("after", given["least"], least=True) if "least" in given else Target("ratio", SLOWER)
        targets = target, Target("path over before", 1.1), Target("unconverged", 0)
        more = {"unit": "real time", "errors": "path", "fine": 1e-2, "turns": 5, "targets": targets}
        whole = {"duration": scene.program.duration, "phases": {"": (0.0, LASTS)}}
        task = _move(given | whole, {"dynamics.step": STEP} if scene.dynamics else {"dynamics": {"step": STEP}})
        rows.append(Row(group="motion", name=f"{given['scene']}, motion", tasks=(task,), **more))
    return rows


def make_contact_rows() -> list[Row]:
    """Return the rows with contact: not slower in any phase, every step converged, and what is wanted of a phase."""
    rows = []
    for given in GROUPS["contact"]:
        unit, targets = given.get("unit", "real time"), [Target("ratio", SLOWER), Target("unconverged", 0)]
        for part, bounds in given.get("wanted", {}).items():
            for name, bound in bounds.items():
                targets.append(Target(name, bound, least=name == "after" and unit == "real time", part=part))
        moves = "file" in given or load_scene(given["scene"]).dynamics
        task = _move(given, _mesh(given) | ({"dynamics.step": given.get("step", STEP)} if moves else {}))
        more = {"unit": unit, "turns": given.get("turns", 3), "targets": tuple(targets)}
        rows.append(Row(group="contact", name=given.get("name", given.get("scene")), tasks=(task,), **more))
    return rows


def _move(given: Mapping[str, Any], overrides: Mapping[str, Any]) -> Task:
    """Return the task of a program, given by its scene or file, its duration and its phases [s], all in equal steps."""
    step = given.get("step", STEP)
    parts = {name: tuple(round(end / step) for end in ends) for name, ends in given["phases"].items()}
    text = (ROOT / given["file"]).read_text(encoding="utf-8") if "file" in given else ""
    more = {"overrides": overrides, "total": round(given["duration"] / step), "parts": parts}
    return Task(scene=given.get("scene", ""), text=text, **more)

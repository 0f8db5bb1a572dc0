# SPDX-License-Identifier: Apache-2.0
"""A run as arrays with one row per step, in one npz file."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from gdfe_ros.analysis.bag_steps import CONTACTS, RECORD, BagStep
from gdfe_ros.analysis.export.columns import Columns
from gdfe_ros.scene import Scene

_LENGTHS = {"X": "m", "positions": "m"}


def write_npz(steps: Iterable[BagStep], scene: Scene, path: Path) -> int:
    """Write the t steps of a run and return t.

    Keys: ``time`` (t,) [s]; ``X`` (n, 3) undeformed vertices [m]; ``cells`` (m, 8 or 4); ``positions`` (t, n, 3)
    float32 [m]; ``eps_eq, J, omega, tangent, energy_density`` (t, m) float32; ``<topic>/<field>`` (t, k) for all other
    topics. If a topic has no message in a step, its row is NaN. ``contacts/<field>`` (p,) contains the contact points
    of all steps, and ``contacts/row`` (p,) the index of each point's step. ``joint_names`` (k,) are the names of the
    entries of joint states. ``units`` is JSON text: dict from array to SI unit, for arrays with a single unit.

    Raises:
        OSError: the file cannot be written.
    """
    columns: dict[str, dict[int, np.ndarray]] = defaultdict(dict)
    times = []
    for number, step in enumerate(steps):
        times.append(step.record.time)
        for name, values in _named(step):
            columns[name][number] = values
        if points := step.samples.get(CONTACTS):
            columns[f"{CONTACTS}/row"][number] = np.full(len(points["x"]), number)
    arrays = {
        name: np.concatenate(list(found.values())) if name.startswith(f"{CONTACTS}/") else _stack(found, len(times))
        for name, found in columns.items()
    }
    known = Columns(scene.actuators)
    arrays |= {"time": np.array(times), "X": scene.mesh.vertices, "cells": scene.mesh.cells}
    units = {name: _LENGTHS.get(name) or known.unit(name) for name in arrays if not name.startswith("joint_states/")}
    texts = {
        "joint_names": np.array(known.joints, dtype=str),
        "units": json.dumps({k: u for k, u in units.items() if u}),
    }
    np.savez_compressed(path, **arrays, **texts)
    return len(times)


def _named(step: BagStep) -> Iterable[tuple[str, np.ndarray]]:
    for topic, fields in step.samples.items():
        if topic == "mesh":
            yield "positions", np.stack([fields[axis] for axis in "xyz"], axis=1)
        else:
            for name, values in fields.items():
                if topic == "strain" and name not in "xyz":
                    yield name, values
                elif topic != "strain":
                    yield (f"record/{name}" if topic == RECORD else f"{topic}/{name}"), values


def _stack(found: dict[int, np.ndarray], count: int) -> np.ndarray:
    first = next(iter(found.values()))
    kind = first.dtype if len(found) == count else np.result_type(first.dtype, np.float32)
    stacked = np.full((count, *first.shape), np.nan if kind.kind == "f" else 0, dtype=kind)
    for number, values in found.items():
        stacked[number] = values
    return stacked

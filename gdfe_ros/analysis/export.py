# SPDX-License-Identifier: Apache-2.0
"""Recorded runs in the formats of other programs: arrays, tables, files of ParaView."""

from __future__ import annotations

import csv
import json
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from gdfe_ros.analysis.bag_run import CONTACTS, JOINTS, RECORD, BagStep
from gdfe_ros.analysis.difference_table import unit_of
from gdfe_ros.mesh import Mesh
from gdfe_ros.scene import Scene
from gdfe_ros.untrusted.bounded_text import quote_formula

if TYPE_CHECKING:
    import meshio

_COMPONENTS = ("x", "y", "z", "w")


class Columns:
    """Names of the actuators and joints in joint states, and units and frames of all columns.

    Args:
        scene: scene with the actuators and arms.

    Attributes:
        joints: names of the actuators, then of the joints of arms, in the order of joint states.
    """

    def __init__(self, scene: Scene) -> None:
        modes = {actuator.name: actuator.mode for actuator in scene.actuators}
        self._commands = {name: mode.unit for name, mode in modes.items()}
        self._positions = {name: mode.position[1] for name, mode in modes.items()}
        self._efforts = {name: mode.effort_unit for name, mode in modes.items()}
        for joint in (joint for arm in scene.arms for joint in arm.joints):
            self._commands[joint.name] = self._positions[joint.name] = joint.unit
            self._efforts[joint.name] = joint.effort_unit
        self.joints = list(self._positions)
        self._frames: dict[str, str] = {}

    def unit(self, column: str) -> str:
        """Return the SI unit of a table's column or of an array; empty for counts, texts and ratios."""
        topic, _, field = column.replace("/", ".").rpartition(".")
        if column.startswith("command."):
            return self._commands.get(column.removeprefix("command."), "")
        if column.startswith(("target.", "set.")):
            return "rad" if field.startswith("r") else "m"
        if topic.startswith(f"{JOINTS}."):
            return self._joint_unit(topic.partition(".")[2], field)
        if ".orientation." in column:
            return ""
        # For wrench.force.z the word before the component determines the unit; z alone would be a length.
        return unit_of(f".{topic.rpartition('.')[2]}.{field}") or unit_of(field)

    def note_frames(self, frames: Mapping[str, str]) -> None:
        """Note the coordinate frames of topics, for the headings of their columns."""
        self._frames |= frames

    def frame(self, column: str) -> str:
        """Return the name of the coordinate frame of a column's numbers; empty for numbers without a frame."""
        if column.rpartition(".")[2] not in _COMPONENTS:
            return ""
        return next((frame for topic, frame in self._frames.items() if column.startswith(f"{topic}.")), "")

    def make_heading(self, column: str) -> str:
        """Return the heading of a column: its name, unit and frame, e.g. ``time [s]``, ``x [m in base_link]``."""
        parts = [self.unit(column), *(["in", frame] if (frame := self.frame(column)) else [])]
        text = " ".join(part for part in parts if part)
        return f"{column} [{text}]" if text else column

    def _joint_unit(self, name: str, field: str) -> str:
        if field == "effort":
            return self._efforts[name]
        unit = self._positions[name]
        return f"{unit or 1}/s" if field == "velocity" else unit


Row = dict[str, Any]
_SHOWN = ("converged", "wall_time")
"""Fields of the step's record that have a column of another name or type."""
_TARGET = ("x", "y", "z", "rx", "ry", "rz")


def step_row(step: BagStep, known: Columns) -> Row:
    """Return the row of a step: time, outcome, consumed commands, and published numbers and short arrays.

    Columns: ``step, time`` [s], ``dt`` [s], ``stamp`` [ns], ``solve_time`` [s], outcomes, ``target.<handle>.x`` to
    ``rz`` [m, rad], ``set.<body>.x`` to ``rz`` [m, rad], ``command.<actuator, load or joint>``, then
    ``<topic>.<field>``, and ``joint_states.<actuator or joint>.<field>``.
    """
    record = step.record
    known.note_frames(step.frames)
    row: Row = {"step": record.step, "time": record.time, "dt": record.dt}
    row |= {"stamp": record.stamp, "solve_time": record.wall_time}
    row |= {"begin": record.begin.value, "converged": record.converged, "cut": record.cut, "message": record.message}
    row |= {name: float(values[0]) for name, values in step.samples[RECORD].items() if name not in _SHOWN}
    for verb, poses in (("target", record.handles), ("set", record.bodies)):
        for name, pose in poses.items():
            six = (*pose.translation, *pose.rotation)
            row |= {f"{verb}.{name}.{part}": value for part, value in zip(_TARGET, six, strict=True)}
    row |= {f"command.{name}": value for name, value in {**record.actuators, **record.loads, **record.joints}.items()}
    for topic, fields in step.samples.items():
        if topic != RECORD:
            for name, values in fields.items():
                row |= _cells(topic, name, values, known)
    return row


def write_csv(rows: Iterable[Row], path: Path, known: Columns) -> None:
    """Write rows as CSV; missing values are empty.

    Headings are names with units and frames, e.g. ``time [s]``, ``probe/tip.pose.position.x [m in base_link]``. Texts
    that a spreadsheet would execute are quoted (`quote_formula`).
    """
    rows = list(rows)
    names = columns(rows)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names)
        writer.writerow({name: quote_formula(known.make_heading(name)) for name in names})
        writer.writerows({name: quote_formula(value) for name, value in row.items()} for row in rows)


def write_parquet(rows: Iterable[Row], path: Path, known: Columns | None = None) -> None:
    """Write rows as Parquet; missing values become null.

    Args:
        rows: dicts from column to value; the columns may differ from row to row.
        path: path of the file.
        known: units and frames of the columns, written as ``unit`` and ``frame`` into each column's metadata; None for
            none.
    """
    import pyarrow
    import pyarrow.parquet

    rows = list(rows)
    table = pyarrow.table({name: [row.get(name) for row in rows] for name in columns(rows)})
    if known is not None:
        fields = [
            field.with_metadata({"unit": known.unit(field.name), "frame": known.frame(field.name)})
            for field in table.schema
        ]
        table = table.cast(pyarrow.schema(fields))
    pyarrow.parquet.write_table(table, path)


def columns(rows: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return the names of all columns in the order of their first occurrence."""
    return list(dict.fromkeys(name for row in rows for name in row))


def _cells(topic: str, field: str, values: np.ndarray, known: Columns) -> Row:
    """Return the columns of a field: one for a number, or one for each of up to 64 doubles; none for larger arrays."""
    if topic == CONTACTS:
        return {f"{topic}.points": len(values)} if field == "x" else {}
    if topic == JOINTS and len(values) == len(known.joints):
        return {f"{topic}.{name}.{field}": value.item() for name, value in zip(known.joints, values, strict=True)}
    if values.size == 1:
        return {f"{topic}.{field}": values[0].item()}
    if values.dtype == np.float64 and values.size <= 64:
        return {f"{topic}.{field}.{place}": value.item() for place, value in enumerate(values)}
    return {}


def write_npz(steps: Iterable[BagStep], scene: Scene, path: Path) -> int:
    """Write the t steps of a run and return t.

    Keys: ``time`` (t,) [s]; ``X`` (n, 3) undeformed vertices [m]; ``cells`` (m, 8 or 4); ``positions`` (t, n, 3)
    float32 [m]; ``eps_eq, J, omega, tangent, energy_density`` (t, m) float32; ``record/<field>`` (t, 1) for the step
    records; ``<topic>/<field>`` (t, k) for all other topics. If a topic has no message in a step, its row is NaN.
    ``contacts/<field>`` (p,) contains the contact points of all steps, and ``contacts/row`` (p,) the index of each
    point's step. ``joint_names`` (k,) are the names of the entries of joint states. ``units`` is JSON text: dict from
    array to SI unit, for arrays with a single unit.

    Raises:
        OSError: the file cannot be written.
    """
    columns: dict[str, dict[int, np.ndarray]] = defaultdict(dict)
    times = []
    for number, step in enumerate(steps):
        times.append(step.record.time)
        for name, values in _name_arrays(step):
            columns[name][number] = values
        if points := step.samples.get(CONTACTS):
            columns[f"{CONTACTS}/row"][number] = np.full(len(points["x"]), number)
    arrays = {
        name: np.concatenate(list(found.values())) if name.startswith(f"{CONTACTS}/") else _stack(found, len(times))
        for name, found in columns.items()
    }
    known = Columns(scene)
    arrays |= {"time": np.array(times), "X": scene.mesh.vertices, "cells": scene.mesh.cells}
    units = {name: known.unit(name) for name in arrays if not name.startswith("joint_states/")}
    texts = {
        "joint_names": np.array(known.joints, dtype=str),
        "units": json.dumps({k: u for k, u in units.items() if u}),
    }
    np.savez_compressed(path, **arrays, **texts)
    return len(times)


def _name_arrays(step: BagStep) -> Iterable[tuple[str, np.ndarray]]:
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


def write_vtk_series(steps: Iterable[BagStep], mesh: Mesh, directory: Path) -> int:
    """Write ``step_<number>.vtu`` for each step with a mesh, and ``run.pvd``; return the number of files.

    Points are the current vertices [m] with ``displacement`` [m]; cells have the fields of the strain topic.

    Raises:
        OSError: a file cannot be written.
    """
    directory.mkdir(parents=True, exist_ok=True)
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    collection = ElementTree.SubElement(root, "Collection")
    for step in steps:
        if "mesh" not in step.samples:
            continue
        name = f"step_{step.record.step:06d}.vtu"
        _grid(step, mesh).write(directory / name, file_format="vtu")
        ElementTree.SubElement(collection, "DataSet", timestep=repr(step.record.time), part="0", file=name)
    ElementTree.ElementTree(root).write(directory / "run.pvd", encoding="utf-8", xml_declaration=True)
    return len(collection)


def _grid(step: BagStep, mesh: Mesh) -> meshio.Mesh:
    import meshio  # tables and arrays need no meshio

    values = step.samples["mesh"]
    positions, shift = (np.stack([values[start + axis] for axis in "xyz"], axis=1) for start in ("", "u"))
    strain = step.samples.get("strain", {})
    return meshio.Mesh(
        positions,
        [(mesh.vtk, mesh.cells)],
        point_data={"displacement": shift},
        cell_data={name: [field] for name, field in strain.items() if name not in ("x", "y", "z")},
    )

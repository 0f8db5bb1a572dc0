# SPDX-License-Identifier: Apache-2.0
"""A run as a table with one row per step: CSV for spreadsheets, Parquet for data frames."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gdfe_ros.analysis.bag_steps import CONTACTS, RECORD, BagStep
from gdfe_ros.analysis.export.columns import JOINTS, Columns
from gdfe_ros.bounded_text import quoted

Row = dict[str, Any]
_SHOWN = ("converged", "wall_time")
"""Fields of the step's record that have a column of another name or type."""
_TARGET = ("x", "y", "z", "rx", "ry", "rz")


def step_row(step: BagStep, known: Columns) -> Row:
    """Return the row of a step: time, outcome, consumed commands, and published numbers and short arrays.

    Columns: ``step, time`` [s], ``dt`` [s], ``stamp`` [ns], ``solve_time`` [s], outcomes, ``target.<handle>.x`` to
    ``rz`` [m, rad], ``set.<body>.x`` to ``rz`` [m, rad], ``command.<actuator, load or joint>``, then
    ``<topic>.<field>``, and ``joint_states.<actuator>.<field>``.
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
    that a spreadsheet would execute are quoted (`quoted`).
    """
    rows = list(rows)
    names = columns(rows)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names)
        writer.writerow({name: quoted(known.headed(name)) for name in names})
        writer.writerows({name: quoted(value) for name, value in row.items()} for row in rows)


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

# SPDX-License-Identifier: Apache-2.0
"""A row for each step with every single number of it: CSV for table programs, Parquet for data frames."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gdfe_ros.analysis.bag_steps import RECORD, BagStep

Row = dict[str, Any]
_TARGET = ("x", "y", "z", "rx", "ry", "rz")


def step_row(step: BagStep) -> Row:
    """Give time and outcome, what was consumed, and every published number that is no array.

    Columns: ``step, time, dt`` [s], ``wall_time`` [s], outcomes, ``target.<handle>.x`` to ``rz`` [m, rad],
    ``command.<actuator>``, then ``<topic>.<field>``.
    """
    record = step.record
    row: Row = {"step": record.step, "time": record.time, "dt": record.dt, "wall_time": record.wall_time}
    row |= {"begin": record.begin.value, "converged": record.converged, "cut": record.cut, "message": record.message}
    row |= {name: float(values[0]) for name, values in step.samples[RECORD].items() if name != "converged"}
    for name, pose in record.handles.items():
        six = (*pose.translation, *pose.rotation)
        row |= {f"target.{name}.{part}": value for part, value in zip(_TARGET, six, strict=True)}
    row |= {f"command.{name}": value for name, value in (record.actuators | record.loads).items()}
    for topic, fields in step.samples.items():
        if topic != RECORD:
            for name, values in fields.items():
                row |= _cells(f"{topic}.{name}", values)
    return row


def write_csv(rows: Iterable[Row], path: Path) -> None:
    """Write rows; what a row does not have stays empty."""
    rows = list(rows)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns(rows))
        writer.writeheader()
        writer.writerows(rows)


def write_parquet(rows: Iterable[Row], path: Path) -> None:
    """Write rows; what a row does not have becomes null."""
    import pyarrow
    import pyarrow.parquet

    rows = list(rows)
    table = pyarrow.table({name: [row.get(name) for row in rows] for name in columns(rows)})
    pyarrow.parquet.write_table(table, path)


def columns(rows: Iterable[Mapping[str, Any]]) -> list[str]:
    """Give the names of all columns in the order in which they first appear."""
    return list(dict.fromkeys(name for row in rows for name in row))


def _cells(name: str, values: np.ndarray) -> Row:
    """Give a number, or the few numbers of a message such as joint states; arrays over the mesh are left out."""
    if values.size == 1:
        return {name: values[0].item()}
    if values.dtype == np.float64 and values.size <= 64:
        return {f"{name}.{place}": value.item() for place, value in enumerate(values)}
    return {}

# SPDX-License-Identifier: Apache-2.0
"""Recordings in CSV files: named columns, with the units in the header."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.match import (
    AXES,
    FACTORS,
    CommandModel,
    CompareModel,
    Source,
    along_of,
    match_observable,
    scale_of,
)
from gdfe_ros.fitting.recording import Series, Track, constant
from gdfe_ros.scene.scene import Scene
from gdfe_ros.untrusted.regular_file import read_text
from gdfe_ros.untrusted.spelling import did_you_mean

_LARGEST = 256_000_000
"""Largest size of a file [bytes]."""
_HEAD = re.compile(r"^(?P<name>.*?)\s*(?:\[(?P<unit>[^\]]*)\])?$")


class TableFile:
    """A CSV file with a header, separated by comma, semicolon or tab; lines that start with # are skipped.

    Args:
        path: path of the file.

    Raises:
        GdfeError: the file cannot be read, or is not a table.

    Attributes:
        names: names of the columns, without units.
        units: dict from column to the unit in brackets in the header, if the unit is known.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            text = read_text(path, most=_LARGEST, encoding="utf-8-sig")
        except (OSError, UnicodeDecodeError) as error:
            raise GdfeError(
                f"{path} cannot be read: {error}; a CSV file or the directory of a bag is needed"
            ) from error
        lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
        if len(lines) < 2:
            raise GdfeError(f"{path} has no rows of data; a header and rows of numbers are needed")
        delimiter = max(",;\t", key=lines[0].count)
        try:
            head, *rows = csv.reader(lines, delimiter=delimiter, skipinitialspace=True)
        except csv.Error as error:
            raise GdfeError(f"{path} is no table: {error}; a header and rows of numbers are needed") from error
        parts = [_HEAD.match(title.strip()) for title in head]
        self.names = [part["name"] for part in parts]
        if twice := sorted({name for name in self.names if self.names.count(name) > 1}):
            raise GdfeError(f"{path}: two columns are named {', '.join(twice)}; remedy: rename or remove one of them")
        self.units = {part["name"]: part["unit"] for part in parts if part["unit"] in FACTORS}
        if bad := [number for number, row in enumerate(rows, 1) if len(row) != len(head)]:
            raise GdfeError(f"{path}: row {bad[0]} has {len(rows[bad[0] - 1])} cells, the header {len(head)}")
        self._cells = dict(zip(self.names, zip(*rows, strict=True), strict=True))

    def __contains__(self, name: str) -> bool:
        return name in self._cells

    def column(self, name: str, unit: str | None = None) -> NDArray[np.float64]:
        """Return a column (m,) in SI units; an empty cell becomes NaN.

        Args:
            name: name in the header, without the unit.
            unit: unit of the numbers; None: the unit in the header, or SI if the header has none.

        Raises:
            GdfeError: there is no such column, or a cell is not a number.
        """
        if name not in self._cells:
            hint = did_you_mean(name, self.names)
            raise GdfeError(f"{self.path} has no column {name!r}; {hint}it has {', '.join(self.names)}")
        numbers = np.empty(len(self._cells[name]))
        for place, cell in enumerate(self._cells[name]):
            try:
                numbers[place] = float(cell) if cell.strip() else np.nan
            except ValueError:
                raise GdfeError(f"{self.path}: column {name!r}, row {place + 1}: {cell!r} is no number") from None
        return numbers * FACTORS[unit or self.units.get(name, "1")]

    def rows(self, ranges: Mapping[str, tuple[float, float]], every: int) -> NDArray[np.intp]:
        """Return the indices (k,) of every ``every``-th row whose columns are in the ``ranges``, in the file's units.

        Raises:
            GdfeError: there is no such row.
        """
        taken = np.ones(len(self._cells[self.names[0]]), dtype=bool)
        for name, (low, high) in ranges.items():
            factor = FACTORS[self.units.get(name, "1")]
            values = self.column(name) / factor
            taken &= (values >= low) & (values <= high)
        found = np.flatnonzero(taken)[::every]
        if not found.size:
            raise GdfeError(f"{self.path}: no row lies in {dict(ranges)}")
        return found


TIMES = ("time", "t", "t_s")
"""Names of the time column that are tried if the match file does not name it."""


class CsvSource:
    """Series and commands of a CSV file.

    Without a match file the columns are named after the scene, as `gdfe export` names them: ``tip.x [mm]`` or
    ``probe/tip.pose.position.x`` for a probe, ``command.tendon`` or ``tendon`` for an actuator or load,
    ``target.tip.x`` for a handle.

    Args:
        source: file, and options from the match file.
        scene: scene with which the recording is compared.

    Raises:
        GdfeError: the file is not a table, lacks a required column, or has no column that is named after the scene.

    Attributes:
        times: times of the rows [s]; the numbers of the rows, from 1, in a file without times.
        timed: whether the file has times.
    """

    def __init__(self, source: Source, scene: Scene) -> None:
        self._source, self._scene, self._table = source, scene, TableFile(source.path)
        self._rows = self._table.rows(source.match.where, source.match.every)
        self.times = self._times()

    def series(self) -> tuple[Series, ...]:
        """Return the measured series."""
        compared = self._source.match.compare or self._find_probes()
        return tuple(self._series(name, model) for name, model in compared.items())

    def tracks(self) -> tuple[Track, ...]:
        """Return the tracks of commands."""
        return tuple(self._track(name, model) for name, model in self._commands().items())

    def _times(self) -> NDArray[np.float64]:
        name = self._source.match.time or next((title for title in TIMES if title in self._table), None)
        self.timed = name is not None
        if name is None:
            if self._scene.dynamics is not None:
                columns = ", ".join(self._table.names)
                text = f"{self._source.path} has no column of time, but the scene has dynamics"
                raise GdfeError(f"{text}; remedy: name it `time`, or name it in the match file; columns: {columns}")
            return np.arange(1.0, self._rows.size + 1.0)
        times = self._mean(name, self._source.match.time_unit)
        if not (np.diff(times) > 0.0).all():
            row = int(self._rows[np.argmax(~(np.diff(times) > 0.0)) + 1]) + 1
            raise GdfeError(f"{self._source.path}: times must ascend; row {row} of column {name!r} does not")
        return times

    def _find_probes(self) -> dict[str, CompareModel]:
        """Return the probes whose position columns are in the file, with the names of these columns."""
        found = {}
        for probe in self._scene.probes:
            for stem in (f"{probe}.", f"probe/{probe}.pose.position."):
                if columns := {axis: f"{stem}{axis}" for axis in AXES if f"{stem}{axis}" in self._table}:
                    found.setdefault(probe, CompareModel(probe=probe, columns=columns))
        if not found:
            probes = ", ".join(f"{name}.x" for name in self._scene.probes) or "e.g. of a probe; the scene has none"
            raise GdfeError(
                f"{self._source.path} has no column with a name of the scene ({probes}); remedy: --match with a file "
                f"that assigns its columns: {', '.join(self._table.names)}"
            )
        return found

    def _series(self, name: str, model: CompareModel) -> Series:
        where = f"recording {self._source.name}, {name}"
        if not model.column and not model.columns:
            raise GdfeError(f"{where}: no column is named; columns: {', '.join(self._table.names)}")
        observable = match_observable(model, self._scene, where)
        labels, along = along_of(model, observable, where)
        columns = [model.column] if model.column else [model.columns[axis] for axis in AXES if axis in model.columns]
        values = np.stack([self._mean(column, model.unit) for column in columns], axis=1)
        first = columns[0] if isinstance(columns[0], str) else columns[0][0]
        factor = scale_of(model.unit or self._table.units.get(first))
        sigma = model.sigma and model.sigma * factor
        return Series(name, observable, self.times, values, labels, along, sigma)

    def _commands(self) -> dict[str, float | CommandModel]:
        if self._source.match.commands:
            return self._source.match.commands
        given = {}
        for item in (*self._scene.actuators, *self._scene.loads):
            if names := [name for name in (f"command.{item.name}", item.name) if name in self._table]:
                given[item.name] = CommandModel(column=names[0])
        for name in (handle.name for handle in self._scene.handles):
            if columns := {axis: f"target.{name}.{axis}" for axis in AXES if f"target.{name}.{axis}" in self._table}:
                given[name] = CommandModel(columns=columns)
        return given

    def _track(self, name: str, model: float | CommandModel) -> Track:
        if not isinstance(model, CommandModel):
            return constant(name, model)
        if model.column:
            return Track(name, self.times, self._mean(model.column, model.unit)[:, None])
        zero = np.zeros(self.times.size)
        columns = [self._mean(model.columns[axis], model.unit) if axis in model.columns else zero for axis in AXES]
        return Track(name, self.times, np.stack(columns, axis=1))

    def _mean(self, names: str | tuple[str, ...], unit: str | None) -> NDArray[np.float64]:
        """Return the mean (m,) of one or several columns in the chosen rows, in SI units."""
        columns = (names,) if isinstance(names, str) else names
        return np.mean([self._table.column(name, unit) for name in columns], axis=0)[self._rows]

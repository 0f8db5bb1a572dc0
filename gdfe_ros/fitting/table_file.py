# SPDX-License-Identifier: Apache-2.0
"""A CSV file as named columns, with the units in its header."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.units import FACTORS
from gdfe_ros.regular_file import read_text
from gdfe_ros.spelling import did_you_mean

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

    def mean(self, names: str | Sequence[str], unit: str | None) -> NDArray[np.float64]:
        """Return the mean (m,) of one or several columns in SI units."""
        columns = [names] if isinstance(names, str) else list(names)
        return np.mean([self.column(name, unit) for name in columns], axis=0)

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

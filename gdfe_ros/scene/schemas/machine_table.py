# SPDX-License-Identifier: Apache-2.0
"""Reader for the tables that testing machines write: strain and stress of a tensile test, converted to SI units."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from gdfe_ros.untrusted.bounded_text import LARGEST_TEXT
from gdfe_ros.untrusted.regular_file import read_bytes

STRAIN_UNITS = {"": 1.0, "1": 1.0, "-": 1.0, "mm/mm": 1.0, "m/m": 1.0, "in/in": 1.0, "%": 0.01, "mm/m": 1e-3}
"""Dict from unit of strain to the strain of one unit."""
STRESS_UNITS = {
    "": 1.0, "pa": 1.0, "n/m2": 1.0, "kpa": 1e3, "mpa": 1e6, "n/mm2": 1e6, "gpa": 1e9, "bar": 1e5, "psi": 6894.757,
    "ksi": 6894757.0, "kgf/cm2": 98066.5, "kg/cm2": 98066.5,
}  # fmt: skip
"""Dict from unit of stress to pascals."""
LENGTH_UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "mm2": 1e-6, "cm2": 1e-4, "m2": 1.0}
"""Dict from unit of length or area to metres or square metres."""
FORCE_UNITS = {"n": 1.0, "kn": 1e3, "mn": 1e-3, "lbf": 4.4482216, "kgf": 9.80665, "gf": 9.80665e-3}

_STRAIN = re.compile(r"strain|dehnung|déformation|deformation|stauchung|\bepsilon\b|ε")
_STRESS = re.compile(r"stress|spannung|contrainte|\bsigma\b|\u03c3")
_TRUE = re.compile(r"\btrue|\bcauchy|wahre|\blog|hencky|vraie")
_FORCE = re.compile(r"\bload\b|force|kraft|charge")
_EXTENSION = re.compile(r"extension|displacement|weg\b|elongation|verlängerung|crosshead|allongement")
_SIZES = {
    "width": re.compile(r"width|breite|largeur"),
    "thickness": re.compile(r"thickness|dicke|épaisseur"),
    "area": re.compile(r"area|querschnitt|section"),
    "length": re.compile(r"length|länge|longueur|gauge"),
}
_UNIT = re.compile(
    r"[\[(]\s*([^\])]*?)\s*[\])]\s*$|\bin\s+(\S+)\s*$|[_ ](%|mpa|kpa|pa|n/mm²|n/mm2|mm/mm)$", re.IGNORECASE
)


@dataclass(frozen=True)
class TableColumn:
    """A column of numbers.

    Attributes:
        place: index of the column.
        factor: factor that converts the numbers to SI units.
    """

    place: int
    factor: float

    def value(self, row: Sequence[str]) -> float | None:
        """Return the value in SI units in a row; None if there is no number."""
        found = _number(row[self.place]) if self.place < len(row) else None
        return None if found is None else self.factor * found


def is_unit_row(row: Sequence[str]) -> bool:
    """Return whether each cell of a row is empty or a unit, and at least one cell is a unit."""
    units = {**STRAIN_UNITS, **STRESS_UNITS, **LENGTH_UNITS, **FORCE_UNITS, "s": 1.0, "sec": 1.0, "min": 1.0, "°c": 1.0}
    plain = [_plain_unit(cell) for cell in row]
    return any(plain) and all(cell in units and not cell.replace(".", "").isdigit() for cell in plain)


def find_columns(
    titles: Sequence[str], units: Sequence[str], above: Sequence[Sequence[str]]
) -> tuple[TableColumn, TableColumn, list[str]] | None:
    """Find the columns of strain and stress by their titles; return both, and remarks on the choice.

    Return None if the titles name no such columns.

    Args:
        titles: cells of the header.
        units: cells of the row below it, or empty texts.
        above: rows above the header, which may state the specimen's size.

    Raises:
        ValueError: there are such columns, but with an unknown unit, or only of true stress.
    """
    stresses = _matching(titles, _STRESS)
    strains = [place for place in _matching(titles, _STRAIN) if place not in stresses]
    remarks: list[str] = []
    strain = _choose(strains, titles, units, STRAIN_UNITS, "strain", remarks)
    stress = _choose(stresses, titles, units, STRESS_UNITS, "stress", remarks)
    if stress is None and (forces := _matching(titles, _FORCE)) and (area := _sizes(above).get("area")):
        force = _choose(forces, titles, units, FORCE_UNITS, "force", remarks)
        stress = TableColumn(force.place, force.factor / area)
        remarks.append(f"stress is {titles[force.place]!r} over the area of {area:.4g} m^2")
    extensions = [place for place in _matching(titles, _EXTENSION) if place not in strains]
    if strain is None and extensions and (length := _sizes(above).get("length")):
        extension = _choose(extensions, titles, units, LENGTH_UNITS, "extension", remarks)
        strain = TableColumn(extension.place, extension.factor / length)
        remarks.append(f"strain is {titles[extension.place]!r} over the length of {length:.4g} m")
    return None if strain is None or stress is None else (strain, stress, remarks)


def _matching(titles: Sequence[str], pattern: re.Pattern[str]) -> list[int]:
    """Return the places of the titles in which a pattern is found."""
    return [place for place, title in enumerate(titles) if pattern.search(title.lower())]


def _choose(
    places: Sequence[int],
    titles: Sequence[str],
    units: Sequence[str],
    known: dict[str, float],
    noun: str,
    remarks: list[str],
) -> TableColumn | None:
    """Return the first column of ``places`` that is not true stress or strain, and its factor; None without columns."""
    usual = [place for place in places if not _TRUE.search(titles[place].lower())]
    if places and not usual:
        text = f"the column {titles[places[0]]!r} is no engineering {noun}"
        raise ValueError(f"{text}; remedy: engineering strain and nominal stress, force over the initial area")
    if not usual:
        return None
    place = usual[0]
    if len(usual) > 1:
        remarks.append(f"{len(usual)} columns of {noun}: the first, {titles[place]!r}, is used")
    given = units[place] if place < len(units) and units[place] else _unit_in(titles[place], known)
    unit = _plain_unit(given)
    if unit not in known:
        allowed = ", ".join(key for key in known if key)
        raise ValueError(f"the column {titles[place]!r} has the unit {given!r}; allowed: {allowed}; remedy: convert it")
    return TableColumn(place, known[unit])


def _unit_in(title: str, known: dict[str, float]) -> str:
    """Return the unit in a title, such as ``Stress [MPa]``; an empty text if there is none.

    Other texts in round brackets, as in ``Tensile strain (Extension)``, are ignored.
    """
    found = _UNIT.search(title)
    unit = next((part for part in found.groups() if part is not None), "") if found else ""
    return unit if "[" in title or _plain_unit(unit) in known or re.search(r"[%/²]|pa$", unit, re.IGNORECASE) else ""


def _plain_unit(cell: str) -> str:
    """Return a unit in lower case, without brackets, with powers as digits: ``N/mm2``."""
    return cell.strip().strip("[]()").strip().lower().replace("²", "2").replace("^2", "2").replace(" ", "")


def _sizes(above: Sequence[Sequence[str]]) -> dict[str, float]:
    """Return area [m^2] and length [m] of the specimen, as far as the rows above the header state them."""
    found: dict[str, float] = {}
    for row in above:
        for name, pattern in _SIZES.items():
            if name not in found and row and pattern.search(row[0].lower()):
                value = _size(row)
                found |= {} if value is None else {name: value}
    if "area" not in found and {"width", "thickness"} <= found.keys():
        found["area"] = found["width"] * found["thickness"]
    return found


def _size(row: Sequence[str]) -> float | None:
    """Return the length [m] or area [m^2] in a row such as ``Width, 6.0, mm``; None if there is none."""
    text = " ".join(row[1:]) if len(row) > 1 else row[0].rpartition(":")[2]
    parts = text.replace(",", ".").split()
    unit = _plain_unit(parts[1]) if len(parts) > 1 else _plain_unit(_unit_in(row[0], LENGTH_UNITS))
    try:
        value = float(parts[0]) * LENGTH_UNITS[unit]
    except (IndexError, KeyError, ValueError):
        return None
    return value if math.isfinite(value) and value > 0.0 else None


_REMEDY = (
    "allowed is a csv file with the columns strain and stress, with their units in the header or below it; without "
    "units, strain is a fraction and stress is in Pa"
)
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?")
_EMPTY = ("", "nan", "n/a", "na", "-", "--", "null", "#n/a")
"""Texts of cells without a number, in lower case."""
_MOST_ROWS, _MOST_COLUMNS, _ABOVE = 100_000, 1000, 60
"""Largest numbers of rows and columns, and number of rows above a header that are searched for the specimen's size."""
_LISTED = 10
_SUMMARY = 4
"""If a file has several tables, those with at most this many rows, header included, are summaries of results."""


@dataclass(frozen=True)
class StressTable:
    """Columns of engineering strain and uniaxial nominal stress [Pa], of equal length.

    Attributes:
        strain: engineering strains.
        stress: nominal stresses [Pa].
        remarks: messages about the columns that were chosen and the rows that were left out.
    """

    strain: tuple[float, ...]
    stress: tuple[float, ...]
    remarks: tuple[str, ...] = ()


def read_stress_table(path: Path) -> StressTable:
    """Return the columns strain and stress [Pa] of the file of a testing machine.

    Separators are commas, semicolons or tabs, decimals have points or commas. Lines above the header are skipped, as
    are lines that start with #. Units are in the header, ``Stress [MPa]``, or in a row below it. Force and extension
    are converted if the lines above the header state width, thickness (or area) and length of the specimen. Rows at the
    end without numbers are left out.

    Args:
        path: the file.

    Raises:
        ValueError: the file cannot be read, has no such columns or several tests, has an unknown unit, has rows that
            are not finite numbers, or has fewer than two rows.
    """
    try:
        return _parse(_text(path))
    except (OSError, csv.Error) as error:
        raise ValueError(f"cannot read {path}: {getattr(error, 'strerror', None) or error}; {_REMEDY}") from error
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _parse(text: str) -> StressTable:
    rows = _number_rows(text)
    places = [place for place in range(len(rows)) if _columns_at(rows, place) is not None]
    if not places:
        titles = [cell.lower() for cell in rows[0][1]]
        raise ValueError(f"line {rows[0][0]}: the header is {titles}; {_REMEDY}")
    begin, end = _find_test(rows, places)
    strain, stress, remarks = _columns_at(rows, begin)
    remarks += [f"the table of results in line {rows[place][0]} is left out" for place in places if place != begin]
    begin += 2 if begin + 1 < len(rows) and is_unit_row(rows[begin + 1][1]) else 1
    points = [_Point(line, strain.value(row), stress.value(row), row) for line, row in rows[begin:end]]
    return _table(points, remarks)


def _number_rows(text: str) -> list[tuple[int, list[str]]]:
    """Return the number and the cells of each line that is neither empty nor a comment."""
    numbered = [(i, line) for i, line in enumerate(text.splitlines(), 1) if line.strip() and line[0] != "#"]
    if not numbered:
        raise csv.Error("it is empty")
    if len(numbered) > _MOST_ROWS:
        raise ValueError(f"it has {len(numbered)} rows; allowed: up to {_MOST_ROWS}; remedy: leave out some rows")
    numbers, lines = zip(*numbered, strict=True)
    return list(zip(numbers, _cells(lines), strict=True))


def _find_test(rows: Sequence[tuple[int, list[str]]], places: Sequence[int]) -> tuple[int, int]:
    """Return the index of the header of the only test, and the index of the row after the end of the test.

    ``places`` are the indices of all headers. Short tables are summaries (`_SUMMARY`). Several tests are an error.
    """
    tests = list(zip(places, [*places[1:], len(rows)], strict=True))
    long = [(begin, end) for begin, end in tests if end - begin > _SUMMARY] if len(tests) > 1 else tests
    if len(long) != 1:
        lines = ", ".join(str(rows[place][0]) for place in places[:_LISTED])
        raise ValueError(f"it has {len(places)} tests, with headers in line {lines}; remedy: one file for each")
    return long[0]


def _text(path: Path) -> str:
    raw = read_bytes(path, most=LARGEST_TEXT)
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        return raw.decode("utf-16", errors="replace")
    if b"\0" in raw:
        raise csv.Error("it is no text")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:  # machines set up in Western Europe write Windows' own code
        return raw.decode("cp1252", errors="replace")


def _cells(lines: Sequence[str]) -> list[list[str]]:
    """Return the cells of each line, with decimal points."""
    delimiter = max(";\t,", key=lambda mark: sum(line.count(mark) > 0 for line in lines) + (mark != ",") * 0.5)
    most = max(line.count(delimiter) for line in lines)
    if most >= _MOST_COLUMNS:
        raise ValueError(f"it has {most + 1} columns; allowed: up to {_MOST_COLUMNS}")
    rows = [next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), []) for line in lines]
    rows = [[cell.strip() for cell in row] for row in rows]
    commas = any(_DECIMAL_COMMA.fullmatch(cell) for row in rows for cell in row)
    points = any(re.fullmatch(r"[-+]?\d*\.\d+(?:[eE][-+]?\d+)?", cell) for row in rows for cell in row)
    if commas and not points:
        return [[_with_point(cell) for cell in row] for row in rows]
    return rows


def _with_point(cell: str) -> str:
    """Replace the decimal comma of a number by a point; other cells are returned unchanged."""
    plain = cell.replace(".", "").replace(" ", "") if re.fullmatch(r"[-+]?\d{1,3}(?:[. ]\d{3})+,\d+", cell) else cell
    return plain.replace(",", ".") if _DECIMAL_COMMA.fullmatch(plain) else cell


def _columns_at(rows: Sequence[tuple[int, list[str]]], place: int) -> tuple[TableColumn, TableColumn, list[str]] | None:
    """Return the columns strain and stress, and remarks on the choice, if row ``place`` is a header; None if not."""
    line, row = rows[place]
    if any(_number(cell) is not None for cell in row):
        return None
    below = rows[place + 1][1] if place + 1 < len(rows) else []
    units = below if is_unit_row(below) else [""] * len(row)
    try:
        return find_columns(row, units, [each for _, each in rows[max(0, place - _ABOVE) : place]])
    except ValueError as error:
        raise ValueError(f"line {line}: {error}") from error


class _Point(NamedTuple):
    """A row below the header: its line number, strain and stress [Pa] (None for a cell without a number), its cells."""

    line: int
    strain: float | None
    stress: float | None
    row: list[str]

    @property
    def count(self) -> int:
        """Number of values among strain and stress that are not None."""
        return (self.strain is not None) + (self.stress is not None)

    @property
    def is_empty(self) -> bool:
        """Whether all cells are empty, or mark a missing value."""
        return all(cell.lower() in _EMPTY for cell in self.row)


def _table(points: Sequence[_Point], remarks: list[str]) -> StressTable:
    last = max((k for k, point in enumerate(points) if point.count == 2), default=-1)
    data, below = points[: last + 1], points[last + 1 :]
    if tail := [point.row for point in below if not point.is_empty]:
        remarks.append(f"{len(tail)} rows below the data are left out, the first: {', '.join(tail[0])[:60]}")
    kept = [point for point in data if not point.is_empty]
    if len(kept) < len(data):
        remarks.append(f"{len(data) - len(kept)} empty rows between the data are left out")
    wrong = [point for point in kept if point.count < 2] + [point for point in below if point.count == 1]
    if listed := wrong or (points if last < 0 else []):
        lines = ", ".join(str(point.line) for point in listed[:_LISTED])
        raise ValueError(f"not two finite numbers in line {lines}; {_REMEDY}")
    if len(kept) < 2:
        raise ValueError(f"it has {len(kept)} rows of data; at least 2 are needed")
    return StressTable(tuple(point.strain for point in kept), tuple(point.stress for point in kept), tuple(remarks))


def _number(cell: str) -> float | None:
    """Return the finite number in a cell; None if there is none."""
    try:
        value = float(cell)
    except ValueError:
        return None
    return value if math.isfinite(value) else None

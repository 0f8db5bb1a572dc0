# SPDX-License-Identifier: Apache-2.0
"""Test data in a csv file: two columns, strain and stress."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

from gdfe_ros.bounded_text import LARGEST_TEXT
from gdfe_ros.regular_file import read_text

_REMEDY = "allowed is a csv file with the header strain,stress and one row of numbers a point, stress in Pa"


@dataclass(frozen=True)
class StressTable:
    """Columns of engineering strain and uniaxial nominal stress [Pa], of equal length."""

    strain: tuple[float, ...]
    stress: tuple[float, ...]


def read_stress_table(path: Path) -> StressTable:
    """Return the columns strain and stress [Pa] of a csv file.

    Args:
        path: the file, with the header strain,stress; separators are commas, semicolons or tabs. Lines that start with
            # are skipped.

    Raises:
        ValueError: the file cannot be read, has another header, has rows that are not two finite numbers, or has fewer
            than two rows.
    """
    try:
        text = read_text(path, most=LARGEST_TEXT, encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"cannot read {path}: {error}; {_REMEDY}") from error
    numbered = [(i, line) for i, line in enumerate(text.splitlines(), 1) if line.strip() and line[0] != "#"]
    if not numbered:
        raise ValueError(f"{path} is empty; {_REMEDY}")
    delimiter = max(",;\t", key=numbered[0][1].count)
    rows = list(csv.reader((line for _, line in numbered), delimiter=delimiter, skipinitialspace=True))
    header = [title.strip().lower() for title in rows[0]]
    if sorted(header) != ["strain", "stress"]:
        raise ValueError(f"{path} line {numbered[0][0]}: the header is {header}; {_REMEDY}")
    points, wrong = [], []
    for (line, _), row in zip(numbered[1:], rows[1:], strict=True):
        point = _point(row)
        wrong += [str(line)] if point is None else []
        points += [point] if point is not None else []
    if wrong:
        raise ValueError(f"{path}: not two finite numbers in line {', '.join(wrong[:10])}; {_REMEDY}")
    if len(points) < 2:
        raise ValueError(f"{path} has {len(points)} rows of data; at least 2 are needed")
    columns = dict(zip(header, zip(*points, strict=True), strict=True))
    return StressTable(strain=columns["strain"], stress=columns["stress"])


def _point(row: list[str]) -> tuple[float, float] | None:
    try:
        numbers = tuple(float(cell) for cell in row)
    except ValueError:
        return None
    return numbers if len(numbers) == 2 and all(map(math.isfinite, numbers)) else None

# SPDX-License-Identifier: Apache-2.0
"""The cases of a sweep: their overrides, and their names on disk."""

from __future__ import annotations

import csv
import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from gdfe_ros.bounded_text import LARGEST_TEXT, load_yaml
from gdfe_ros.errors import GdfeError
from gdfe_ros.regular_file import read_text


@dataclass(frozen=True)
class Case:
    """One set of overrides: dict from dotted scene key to value."""

    overrides: Mapping[str, Any]

    @property
    def name(self) -> str:
        """Name that depends only on the overrides, so that a resumed sweep finds its earlier results."""
        text = json.dumps(dict(self.overrides), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def grid_cases(axes: Mapping[str, Sequence[Any]], rows: Sequence[Mapping[str, Any]] = ({},)) -> list[Case]:
    """Return a case for each row of overrides with each combination of the axes' values; equal cases occur once."""
    cases = [
        Case({**row, **dict(zip(axes, values, strict=True))}) for row in rows for values in product(*axes.values())
    ]
    return list({case.name: case for case in cases}.values())


def read_axes(entries: Iterable[str]) -> dict[str, list[Any]]:
    """Return dict from key to values, read from ``KEY=VALUES``: a YAML list, or ``low:high:count``.

    ``low:high:count`` stands for ``count`` evenly spaced numbers.

    Raises:
        GdfeError: an entry has neither form.

    Example:
        >>> read_axes(["materials.e20.young=1e4:4e4:4", "mesh.bar.cells=[[10, 1, 1], [25, 2, 2]]"])
    """
    axes = {}
    for entry in entries:
        key, separator, text = entry.partition("=")
        if not separator:
            raise GdfeError(f"--grid takes KEY=VALUES, got {entry!r}")
        axes[key.strip()] = _values(key, text.strip())
    return axes


def read_list(path: Path) -> list[dict[str, Any]]:
    """Return a list of overrides, read from CSV with the keys in the first line, or from a YAML list of mappings.

    Raises:
        GdfeError: the file does not contain such a list, or the list is empty.
        OSError: the file cannot be read.
    """
    try:
        text = read_text(path, most=LARGEST_TEXT)
        if path.suffix == ".csv":
            rows = [{key: load_yaml(value) for key, value in row.items()} for row in csv.DictReader(text.splitlines())]
        else:
            rows = load_yaml(text)
    except (yaml.YAMLError, ValueError, TypeError, csv.Error) as error:  # a row of a table may be too long or too short
        raise GdfeError(f"{path} cannot be read: {' '.join(str(error).split())[:200]}") from error
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        raise GdfeError(f"{path} must hold a list of mappings from dotted keys to values, or CSV with keys on top")
    return rows


def _values(key: str, text: str) -> list[Any]:
    parts = text.split(":")
    try:
        if len(parts) == 3:
            values = np.linspace(float(parts[0]), float(parts[1]), int(parts[2])).tolist()
        else:
            values = load_yaml(text)
    except (ValueError, yaml.YAMLError) as error:
        raise GdfeError(f"--grid {key}: {text!r} is no list and no low:high:count: {error}") from error
    if not isinstance(values, list) or not values:
        raise GdfeError(f"--grid {key}: {text!r} must be a list such as [1, 2, 3], or low:high:count from 1 on")
    return values

# SPDX-License-Identifier: Apache-2.0
"""The tables of a report on coarse meshes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.markdown import left_out, markdown_table
from gdfe_ros.solver.settings import Torsion

TITLES = {
    "torsion": "torsion of a square bar, stiffness",
    "torsion 2:1": "torsion of a bar twice as wide as thick, stiffness",
    "bending": "bending of the square bar, stiffness",
    "bending, nu 0.495": "bending of the square bar, nu 0.495, stiffness",
    "pad": "bonded pad, nu 0.495, stiffness",
    "tube": "thick tube, nu 0.495, growth",
}
MEASURED = {
    "force or moment": ("reaction", "{:+.2%}"),
    "displacement": ("displacement", "{:.2%}"),
    "iterations": ("iterations", "{}"),
}
"""Pairs of column heading and key of the number, for the table of the bars."""


def all_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return dict from name to table of a report."""
    return {
        "coarse_meshes": small_table(report) + left_out(report["missing"]),
        "coarse_bars": bar_table(report["bars"]),
    }


def small_table(report: Mapping[str, Any]) -> str:
    """Return the table with a row for each problem and number of cells across."""
    errors = report["errors"]
    codes = list(next(iter(errors.values())))
    rows = [
        [TITLES[name], f"{across}", *(f"{100.0 * found[code][i]:+.2f}" for code in codes)]
        for name, found in errors.items()
        for i, across in enumerate(report["across"])
    ]
    return markdown_table(("error [%]", "cells across", *codes), rows)


def bar_table(bars: Sequence[Mapping[str, Any]]) -> str:
    """Return the table with a row for each scene and mesh: errors and iterations for both kinds of torsion."""
    heads = ("scene", "cells", *(f"{what}, {torsion.value}" for what in MEASURED for torsion in Torsion))
    rows = []
    for first in range(0, len(bars), len(Torsion)):
        kinds = bars[first : first + len(Torsion)]
        cells = [form.format(kind[what]) for what, form in MEASURED.values() for kind in kinds]
        rows.append([kinds[0]["scene"], kinds[0]["cells"], *cells])
    return markdown_table(heads, rows)

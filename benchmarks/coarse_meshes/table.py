# SPDX-License-Identifier: Apache-2.0
"""The table of a report."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from benchmarks.markdown import markdown_table

TITLES = {
    "torsion": "torsion of a square bar, stiffness",
    "bending": "bending of it, stiffness",
    "bending, nu 0.495": "bending of it, nu 0.495, stiffness",
    "pad": "bonded pad, nu 0.495, stiffness",
    "tube": "thick tube, nu 0.495, growth",
}


def all_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return the table of a report by name: a row for each problem and number of cells across."""
    errors = report["errors"]
    codes = list(next(iter(errors.values())))
    rows = [
        [TITLES[name], f"{across}", *(f"{100.0 * found[code][i]:+.2f}" for code in codes)]
        for name, found in errors.items()
        for i, across in enumerate(report["across"])
    ]
    return {"coarse_meshes": markdown_table(("error [%]", "cells across", *codes), rows)}

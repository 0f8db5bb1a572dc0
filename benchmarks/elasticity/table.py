# SPDX-License-Identifier: Apache-2.0
"""The table of a report of the elasticity benchmark."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import gmean

from benchmarks.markdown import markdown_table

Run = Mapping[str, Any]


def common(runs: Sequence[Run]) -> list[tuple[str, int]]:
    """Return the pairs of problem and unknowns that every row has tried, in the order of the runs."""
    rows: dict[tuple[str, int], set[str]] = {}
    for run in runs:
        rows.setdefault((run["problem"], run["unknowns"]), set()).add(run["row"])
    return [key for key, tried in rows.items() if len(tried) == len({run["row"] for run in runs})]


def size_table(runs: Sequence[Run]) -> dict[str, str]:
    """Return the table with failures, times and errors of each row, on meshes that all rows have tried."""
    lines, keys = [], common(runs)
    for name in dict.fromkeys(run["row"] for run in runs):
        for size in sorted({unknowns for _, unknowns in keys}):
            names = [problem for problem, unknowns in keys if unknowns == size]
            tried = [r for r in runs if r["row"] == name and r["unknowns"] == size and r["problem"] in names]
            done = [run for run in tried if not run["message"]]
            if not done:
                continue
            lines.append(
                [
                    name,
                    str(size),
                    f"{len(tried) - len(done)} of {len(tried)}",
                    f"{gmean([run['time'] for run in done]):.3f}",
                    f"{np.median([run['iterations'] for run in done]):.0f}",
                    f"{max(run['steps'] for run in done)}",
                    f"{100.0 * gmean([run['error'] for run in done]):.3f}",
                    f"{100.0 * max((run['force'] for run in done), key=abs):+.2f}",
                    f"{max(run['decrement'] for run in done):.0e}",
                ]
            )
    heads = (
        "row", "unknowns", "failed", "processor time [s]", "iterations", "most load steps", "error [%]",
        "largest force error [%]", "largest decrement",
    )  # fmt: skip
    return {"elasticity": markdown_table(heads, lines)}

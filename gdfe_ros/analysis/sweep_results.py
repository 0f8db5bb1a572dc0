# SPDX-License-Identifier: Apache-2.0
"""Results of a sweep as one table and one picture."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from gdfe_ros.analysis.export import Row

SHOWN = ("energy", "eps_eq_max", "solve_time")
_LABELS = {"energy": "strain energy [J]", "eps_eq_max": "largest eps_eq", "solve_time": "solve time [s]"}


def flat_row(case: str, overrides: dict[str, Any], result: dict[str, Any]) -> Row:
    """Return a row of the table: the case, its overrides (``set.<key>``, lists as JSON text), then its result."""
    settings = {f"set.{key}": _plain(value) for key, value in overrides.items()}
    return {"case": case, **settings, **result}


def draw_results(rows: Sequence[Row], path: Path, *, title: str) -> None:
    """Write the picture of `results_figure`.

    Raises:
        OSError: the picture cannot be written.
    """
    results_figure(rows, title=title).savefig(path)


def results_figure(rows: Sequence[Row], *, title: str, shown: Sequence[str] = SHOWN) -> Figure:
    """Return a figure of the ``shown`` quantities over the first varied key.

    Each combination of the other varied keys has a line. A cross marks a case that did not converge, at its last value,
    or a case that failed, at the bottom.
    """
    keys = [key for key in rows[0] if key.startswith("set.") and len({row.get(key) for row in rows}) > 1]
    first, others = (keys[0], keys[1:]) if keys else ("case", [])
    figure = Figure(figsize=(4.2 * len(shown), 4.0), dpi=120, layout="constrained")
    for axes, name in zip(np.atleast_1d(figure.subplots(1, len(shown))), shown, strict=True):
        _draw(axes, rows, first, others, name)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    if others and len(labels) <= 12:
        figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=7)
    figure.suptitle(title, fontsize=11)
    return figure


def _draw(axes: Axes, rows: Sequence[Row], first: str, others: Sequence[str], name: str) -> None:
    numeric = all(isinstance(row.get(first), int | float) for row in rows)
    order = list(dict.fromkeys(row.get(first) for row in rows))

    def place(row: Row) -> float:
        return row[first] if numeric else order.index(row.get(first))

    failed = [row for row in rows if row["status"] != "converged"]
    groups: dict[tuple[Any, ...], list[tuple[float, float]]] = {}
    for row in rows:
        points = groups.setdefault(tuple(row.get(key) for key in others), [])
        points += [] if row in failed else [(place(row), row[name])]
    for values, points in groups.items():
        label = ", ".join(f"{key.removeprefix('set.')}={value}" for key, value in zip(others, values, strict=True))
        axes.plot(*np.reshape(sorted(points), (-1, 2)).T, marker="o", markersize=3, linewidth=1, label=label)
    if failed:
        bottom = axes.get_ylim()[0]
        heights = [bottom if row.get(name) is None else row[name] for row in failed]
        axes.plot([place(row) for row in failed], heights, "rx", label="failed or not converged")
    if numeric:
        axes.xaxis.set_major_locator(MaxNLocator(5))
        axes.ticklabel_format(axis="x", scilimits=(-3, 4), useMathText=True)
    else:
        axes.set_xticks(range(len(order)), [str(value)[:16] for value in order], rotation=30, ha="right", fontsize=7)
    axes.set_xlabel(first.removeprefix("set."))
    axes.set_ylabel(_LABELS.get(name, name))
    axes.grid(alpha=0.3)


def _plain(value: Any) -> Any:
    return value if isinstance(value, int | float | str | bool) else json.dumps(value)

# SPDX-License-Identifier: Apache-2.0
"""Tables and picture of a report of the elasticity benchmark."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.elasticity.problem import DECREMENT, OWN, PROBLEMS, RATIOS, Kind
from benchmarks.markdown import markdown_table

Run = Mapping[str, Any]
BUDGETS = (0.05, 0.2, 1.0)
"""Processor times [s] at which errors are compared; the meshes that other rows leave out take longer."""
COMPARED = 6591
"""Unknowns of the largest mesh that all rows must have tried on a problem of the budgets."""
GOAL = 0.01
"""Error to which a problem is solved in the data profile."""
LEAST = 1000
"""Unknowns from which on runs are compared at equal error."""


def all_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return dict from name to table of a report."""
    runs = report["runs"]
    return {
        "elasticity": size_table(runs),
        "elasticity_nu": ratio_table(runs),
        "elasticity_equal": equal_table(runs),
        "elasticity_budget": budget_table(runs),
    }


def rows_of(runs: Sequence[Run]) -> list[str]:
    """Return the names of the rows, in their order."""
    return list(dict.fromkeys(run["row"] for run in runs))


def solved(runs: Sequence[Run], **given: Any) -> list[Run]:
    """Return the successful runs with the ``given`` values."""
    return [run for run in runs if not run["message"] and all(run[key] == value for key, value in given.items())]


def common(runs: Sequence[Run]) -> list[tuple[str, int]]:
    """Return the pairs of problem and unknowns that every row has tried, in the order of the runs."""
    tried = [{(run["problem"], run["unknowns"]) for run in runs if run["row"] == row} for row in rows_of(runs)]
    return [
        key for key in dict.fromkeys((run["problem"], run["unknowns"]) for run in runs) if all(key in t for t in tried)
    ]


def compared(runs: Sequence[Run]) -> list[str]:
    """Return the problems that every row has tried on a mesh of `COMPARED` unknowns, all problems if there are none."""
    names = [name for name, unknowns in common(runs) if unknowns == COMPARED]
    return names or list(dict.fromkeys(name for name, _ in common(runs)))


def mean(values: Sequence[float]) -> float:
    """Return the geometric mean."""
    return float(np.exp(np.mean(np.log(values))))


def size_table(runs: Sequence[Run]) -> str:
    """Return the table with failures, times and errors of each row, on meshes that all rows have tried."""
    lines, keys = [], common(runs)
    for name in rows_of(runs):
        for size in sorted({unknowns for _, unknowns in keys}):
            names = [problem for problem, unknowns in keys if unknowns == size]
            tried = [r for r in runs if r["row"] == name and r["unknowns"] == size and r["problem"] in names]
            done = solved(tried)
            if not done:
                continue
            lines.append(
                [
                    name,
                    str(size),
                    f"{len(tried) - len(done)} of {len(tried)}",
                    f"{mean([run['time'] for run in done]):.3f}",
                    f"{np.median([run['iterations'] for run in done]):.0f}",
                    f"{max(run['steps'] for run in done)}",
                    f"{100.0 * mean([run['error'] for run in done]):.3f}",
                    f"{100.0 * max((run['force'] for run in done), key=abs):+.2f}",
                    f"{max(run['decrement'] for run in done):.0e}",
                ]
            )
    heads = (
        "row", "unknowns", "failed", "processor time [s]", "iterations", "most load steps", "error [%]",
        "largest force error [%]", "largest decrement",
    )  # fmt: skip
    return markdown_table(heads, lines)


def ratio_table(runs: Sequence[Run], unknowns: int = 2187) -> str:
    """Return the table of the sweep of nu, with the error and the error of the force in each cell."""
    sweep = {p.ratio: p.name for p in PROBLEMS if p.kind is Kind.STRETCH and p.amount == 1.3}
    lines = []
    for name in rows_of(runs):
        cells = []
        for ratio in RATIOS:
            found = solved(runs, row=name, unknowns=unknowns, problem=sweep[ratio])
            cells += [f"{100 * run['error']:.2f}, {100 * run['force']:+.1f}" for run in found] or ["failed"]
        lines.append([name, *cells])
    return markdown_table(("error, force error [%]", *(f"nu {ratio:g}" for ratio in RATIOS)), lines)


def own_time(runs: Sequence[Run], problem: str, error: float) -> float:
    """Return the time [s] in which this solver has an error, interpolated between its best runs; inf if it has none.

    The best runs are those of all own rows that no faster run beats in error. Logarithms are interpolated. An error
    above that of the fastest run takes the time of the fastest run.
    """
    ours = [(run["time"], run["error"]) for run in solved(runs, problem=problem) if run["row"].startswith(OWN)]
    front: list[tuple[float, float]] = []
    for each in sorted(ours):
        if not front or each[1] < front[-1][1]:
            front.append(each)
    times, least = np.log(np.array(front)).T
    return float(np.exp(np.interp(-np.log(error), -least, times, right=np.inf)))


def equal_ratios(runs: Sequence[Run]) -> dict[str, list[float]]:
    """Return dict from other row to its time over `own_time` at its error, for each run; 0 if ours do not reach it."""
    found: dict[str, list[float]] = {}
    for run in solved(runs):
        if not run["row"].startswith(OWN) and run["unknowns"] >= LEAST:
            found.setdefault(run["row"], []).append(run["time"] / own_time(runs, run["problem"], run["error"]))
    return found


def equal_table(runs: Sequence[Run]) -> str:
    """Return the table of times at equal error: how many times faster this solver is than each other row."""
    lines = []
    for name, ratios in equal_ratios(runs).items():
        reached = [ratio for ratio in ratios if ratio > 0.0]
        lines.append(
            [name, str(len(ratios)), *(f"{what(reached):.2f}" if reached else "-" for what in (min, np.median, max)),
             str(len(ratios) - len(reached))]
        )  # fmt: skip
    heads = ("row", "runs", "least ratio", "median ratio", "largest ratio", "error not reached by ours")
    return markdown_table(heads, lines)


def budget_table(runs: Sequence[Run]) -> str:
    """Return the table of the least error within a processor time, as the mean over the problems."""
    names, lines = compared(runs), []
    for row in rows_of(runs):
        cells = []
        for budget in BUDGETS:
            within = [
                [run["error"] for run in solved(runs, row=row, problem=name) if run["time"] <= budget] for name in names
            ]
            best = [min(errors) for errors in within if errors]
            cells.append(f"{100.0 * mean(best):.3f} ({len(best)})" if best else "-")
        lines.append([row, *cells])
    heads = (f"error [%] (problems solved, of {len(names)})", *(f"{budget:g} s" for budget in BUDGETS))
    return markdown_table(heads, lines)


def worst(report: Mapping[str, Any]) -> str:
    """Return a summary: failures and decrements of our rows, the least ratio, and the doubt of the reference."""
    ours = [run for run in report["runs"] if run["row"].startswith(OWN)]
    ratios = [ratio for found in equal_ratios(report["runs"]).values() for ratio in found if ratio > 0.0]
    doubt = max(found["error"] for found in report["doubt"].values())
    return (
        f"{len(ours) - len(solved(ours))} of our {len(ours)} runs failed; largest decrement "
        f"{max(run['decrement'] for run in solved(ours)):.1e} of {DECREMENT:g}; least ratio at equal error "
        f"{min(ratios, default=np.nan):.2f}; a coarser mesh changes the reference by at most {100.0 * doubt:.3f} %"
    )


def draw(report: Mapping[str, Any], path: Path) -> None:
    """Draw the data profile and the performance profile of all rows."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    runs = report["runs"]
    problems, keys = compared(runs), common(runs)
    best = {key: min(run["time"] for run in solved(runs, problem=key[0], unknowns=key[1])) for key in keys}
    figure, (data, performance) = pyplot.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
    for row in rows_of(runs):
        within = [
            min((r["time"] for r in solved(runs, row=row, problem=name) if r["error"] <= GOAL), default=np.inf)
            for name in problems
        ]
        ratios = [
            min((r["time"] for r in solved(runs, row=row, problem=key[0], unknowns=key[1])), default=np.inf) / best[key]
            for key in keys
        ]
        style = {"linewidth": 2.2} if row.startswith(OWN) else {"linewidth": 1.2, "linestyle": "--"}
        for axes, values in ((data, within), (performance, ratios)):
            places = np.sort(np.array(values)[np.isfinite(values)])
            shares = np.arange(1, len(places) + 1) / len(values)
            axes.step([*places, 1e3], [*shares, len(places) / len(values)], where="post", label=row, **style)
    data.set(xlabel="processor time [s]", ylabel=f"problems solved to {100 * GOAL:g} %", xlim=(0.01, BUDGETS[-1]))
    performance.set(xlabel="time / least time on as many unknowns", ylabel="solved", xlim=(1, 300))
    for axes in (data, performance):
        axes.set(xscale="log", ylim=(0.0, 1.03))
        axes.grid(alpha=0.3)
    performance.legend(fontsize=8, loc="lower right")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    pyplot.close(figure)

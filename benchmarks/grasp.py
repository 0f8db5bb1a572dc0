# SPDX-License-Identifier: Apache-2.0
"""Processor time divided by simulated time in each phase of the scene `grasp`, and the times of the solver's parts."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from benchmarks.markdown import markdown_table
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.contact.contact import Contact
from gdfe_ros.solver.forces.actuation import Actuation
from gdfe_ros.solver.minimise import minimiser
from gdfe_ros.solver.minimise.level import TangentLevel

PHASES = {
    "closes": (0.0, 1.2),
    "lifts": (1.2, 2.2),
    "holds": (2.2, 12.4),
    "puts down": (12.4, 13.4),
    "opens": (13.4, 15.0),
}
"""Dict from phase to its start and end [s]."""
PARTS = {
    "iterations": (minimiser, "descend"),
    "tangents": (TangentLevel, "take"),
    "updates of contact forces": (Actuation, "update"),
    "points that may touch": (Contact, "begin"),
}
"""Dict from part of the solver to the owner and name of the timed function. The table shows all other time as
"everything else".
"""


def measure() -> dict[str, Any]:
    """Play the program; return iterations and processor time of each phase."""
    simulation, rows = Simulation(load_scene("grasp")), []
    simulation.warm_up()
    spent: dict[str, float] = defaultdict(float)
    with _clocked(spent):
        plays = simulation.play()
        for phase, (first, last) in PHASES.items():
            spent.clear()
            iterations, times = [], []
            while simulation.time < last - 1e-6:
                began = time.process_time()
                result = next(plays)
                times.append(time.process_time() - began)
                assert result.converged, result.message
                iterations.append(result.iterations)
            shares = {part: spent[part] / sum(times) for part in PARTS}
            rows.append(
                {
                    "phase": phase,
                    "lasts": last - first,
                    "iterations": float(np.mean(iterations)),
                    "most": max(iterations),
                    "seconds": sum(times),
                    "shares": shares,
                }
            )
    return {"grasp": rows}


def all_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return dict from name to the table of a report; its parts are those that the report has."""
    rows, parts = [], tuple(report["grasp"][0]["shares"])
    heads = (
        "phase", "duration [s]", "iterations per step: mean (largest)", "processor time / simulated time", *parts,
        "everything else",
    )  # fmt: skip
    for row in report["grasp"]:
        shares = [row["shares"][part] for part in parts]
        rows.append(
            [
                row["phase"],
                f"{row['lasts']:.1f}",
                f"{row['iterations']:.1f} ({row['most']})",
                f"{row['seconds'] / row['lasts']:.2f}",
                *(f"{100.0 * share:.0f} %" for share in [*shares, 1.0 - sum(shares)]),
            ]
        )
    whole = sum(row["seconds"] for row in report["grasp"]), sum(row["lasts"] for row in report["grasp"])
    rows.append(["all", f"{whole[1]:.1f}", "", f"{whole[0] / whole[1]:.2f}", *[""] * (len(parts) + 1)])
    return {"grasp": markdown_table(heads, rows)}


@contextmanager
def _clocked(spent: dict[str, float]) -> Iterator[None]:
    """Add the time [s] of each part to ``spent`` inside the ``with`` block. No part calls another part."""
    kept = {part: getattr(*place) for part, place in PARTS.items()}
    for part, (owner, name) in PARTS.items():
        setattr(owner, name, _clock(kept[part], part, spent))
    try:
        yield
    finally:
        for part, (owner, name) in PARTS.items():
            setattr(owner, name, kept[part])


def _clock(method: Callable[..., Any], part: str, spent: dict[str, float]) -> Callable[..., Any]:
    def timed(*arguments: Any, **options: Any) -> Any:
        began = time.process_time()
        try:
            return method(*arguments, **options)
        finally:
            spent[part] += time.process_time() - began

    return timed

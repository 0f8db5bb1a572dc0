# SPDX-License-Identifier: Apache-2.0
"""Report of a bag as an HTML page, in one pass over the messages."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np

from gdfe_ros.analysis.bag_run import BagRun, BagSteps
from gdfe_ros.analysis.report import charts
from gdfe_ros.analysis.report.animation import Animation, colour_fields
from gdfe_ros.analysis.report.history import RunHistory, StrainHistogram
from gdfe_ros.analysis.report.summary import is_paced_by_wall, run_rows, scene_rows
from gdfe_ros.analysis.report.template import build_page, tabulate
from gdfe_ros.errors import RecordingError


@dataclass(frozen=True)
class ReportFacts:
    """Contents of a report: steps of the run, frames of the animation, size of the file [B]."""

    steps: int
    frames: int
    size: int


def write_report(bag: str | Path, path: Path) -> ReportFacts:
    """Write the report of a bag.

    Args:
        bag: directory of a bag that ``sim_node`` recorded.
        path: path of the HTML file.

    Raises:
        RecordingError: the bag cannot be read, or has no step.
        OSError: the file cannot be written.

    Example:
        >>> write_report("runs/bend5/bag", Path("bend5.html"))
    """
    run = BagRun(bag)
    history, animation, strays = _gather(run)
    description, arrays = animation.to_page()
    steps, frames = len(history.time), len(description["times"])
    text = build_page(
        title=f"{run.scene.name}: {steps} steps, {max(history.time):.4g} s",
        description=run.scene.description,
        tables=[tabulate("Run", run_rows(run, history)), tabulate("Scene and origin", scene_rows(run))],
        charts=charts.all_charts(history, run.scene, dt=_dt(run), paced=is_paced_by_wall(run)),
        animation=description,
        arrays=arrays,
        remarks=_remarks(history, animation, frames, strays),
    )
    path.write_text(text, encoding="utf-8")
    return ReportFacts(steps, frames, path.stat().st_size)


def _gather(run: BagRun) -> tuple[RunHistory, Animation, int]:
    """Read the bag once; return its history, its animation, and the number of messages that belong to no step."""
    count, source = len(run.records), BagSteps(run)
    stream = iter(source)
    first = next(stream, None)
    if first is None:
        raise RecordingError(f"bag {run.reader.path} holds no step: there is nothing to report")
    history = RunHistory(StrainHistogram(count, columns=charts.COLUMNS))
    animation = Animation(run.scene, count, colour_fields(first))
    for number, step in enumerate(chain([first], stream)):
        history.add(step)
        animation.add(number, step)
    return history, animation, (source.strays + source.tail).total()


def _remarks(history: RunHistory, animation: Animation, frames: int, strays: int) -> list[str]:
    steps, span = len(history.time), animation.scene.mesh.size
    columns = min(charts.COLUMNS, steps)
    remarks = [
        f"The surface shows {frames} of {steps} steps, evenly spread; positions are rounded to 1/65535 of the box "
        f"that the run fills (below {span / 32767:.1e} m), colours to 1/65535 of their range over the run.",
        f"The strain histogram counts every cell of every step, averaged over {columns} groups of steps.",
        charts.thinning(history),
        "Reactions are the forces and moments that a handle or obstacle exerts on the body, in the axes of the rest "
        "frame.",
        _accounting(history),
        "This page needs no network; plotly.js (MIT licence) is part of it.",
    ]
    if strays:
        remarks.append(f"{strays} messages belong to no step in the bag and are left out.")
    return [text for text in remarks if text]


def _accounting(history: RunHistory) -> str:
    if not history.energies:
        return ""
    return (
        "Energies count from the start of the run: kinetic + elastic + potential = start + work - dissipated, "
        "except for the energy that the time integration creates or loses. Dissipated is the energy lost in "
        "dashpots and in the branches of Prony series."
    )


def _dt(run: BagRun) -> float:
    steps = [record.dt for record in run.records if record.dt > 0.0]
    return float(np.median(steps)) if steps else 0.0

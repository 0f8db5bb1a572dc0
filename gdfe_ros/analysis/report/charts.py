# SPDX-License-Identifier: Apache-2.0
"""Charts over time, as data and layout for plotly.js."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.analysis.bag_run import CONTACTS, JOINTS, RECORD
from gdfe_ros.analysis.difference_table import unit_of
from gdfe_ros.analysis.report.history import RunHistory, energy_balance
from gdfe_ros.scene import Scene

MOST_POINTS = 3000
"""Largest number of points in a series; longer series are thinned."""
COLUMNS, BINS = 300, 48
"""Largest number of groups of steps, and number of classes of strain, in the strain histogram."""
_COLOURS = ("#3266ad", "#c2562d", "#2e8b57", "#8455a8", "#a07b1f", "#4b9fb5", "#b0436e", "#6b6f76")
_AXES = "xyz"

Chart = dict[str, Any]


def all_charts(history: RunHistory, scene: Scene, *, dt: float, paced: bool = False) -> list[Chart]:
    """Return all charts of a run; charts without data are left out.

    Args:
        history: series of the run.
        scene: scene of the run.
        dt: usual time step [s], drawn as a line in the chart of solve times; 0 for no line.
        paced: whether to show by how much the steps are late, because the wall clock paced them.
    """
    charts = [
        *_motion(history, scene),
        _vector_chart(history, "Reaction forces", "force [N]", "wrench.force"),
        _vector_chart(history, "Reaction moments", "moment [N m]", "wrench.torque"),
        _vector_chart(history, "Forces on contact sensors", "force [N]", "wrench.force", sensors=True),
        _vector_chart(history, "Moments on contact sensors", "moment [N m]", "wrench.torque", sensors=True),
        *_actuators(history, scene),
        *_others(history),
        _strain(history),
        _lines(history, "Strain energy", "energy [J]", {"strain energy": history.responses["step_record", "energy"]}),
        _lines(history, "Energies of the motion", "energy [J]", history.energies),
        _lines(history, "Balance of energy", "energy [J]", energy_balance(history)),
        _lines(history, "Least det F", "[1]", {"least det F": history.responses["step_record", "min_det"]}),
        _cost(history, "Solver iterations", "iterations a step", {"iterations": history.costs["iterations"]}),
        _residuals(history, scene.solver.tolerance),
        _times(history, dt),
        *([_cost(history, "Lateness", "late by [s]", {"late by": history.lateness()})] if paced else []),
        _cost(history, "Skipped work", "times a step", _select(history.costs, "skipped.")),
    ]
    return [chart for chart in charts if chart["data"]]


def thinning(history: RunHistory) -> str:
    """Return a remark that describes the thinning of the charts; empty if they are not thinned."""
    stride = _stride(len(history.time))
    if stride == 1:
        return ""
    return (
        f"Charts show every {stride}th of {len(history.time)} steps; for iterations, error estimates, times and "
        f"skipped work they show the largest value of each {stride} steps"
    )


def _motion(history: RunHistory, scene: Scene) -> list[Chart]:
    """Return charts of positions and rotations of commanded handles and obstacles, and of all other commands."""
    charts, sections = [], {handle.name: handle.section for handle in scene.handles}
    for name, targets in history.targets.items():
        table = np.array(targets)
        series = {f"commanded {axis}": table[:, place] for place, axis in enumerate(_AXES)}
        topic = f"{sections[name]}/{name}/pose"
        found = {f"found {axis}": history.responses.get((topic, f"pose.position.{axis}")) for axis in _AXES}
        series |= {label: values for label, values in found.items() if values is not None}
        charts.append(_lines(history, f"Position of {name}, from rest", "displacement [m]", series))
        if np.any(table[:, 3:]):
            turns = {f"commanded {axis}": np.rad2deg(table[:, 3 + place]) for place, axis in enumerate(_AXES)}
            charts.append(_lines(history, f"Rotation vector of {name}", "component [deg]", turns))
    groups: dict[str, dict[str, list[float]]] = {}
    labels = _command_labels(scene)
    for name, values in history.commands.items():
        groups.setdefault(labels.get(name, ""), {})[name] = values
    for label, series in groups.items():
        title = "Commands" if len(groups) == 1 else f"Commands: {label.partition(' [')[0]}"
        charts.append(_lines(history, title, label, series))
    return charts


def _command_labels(scene: Scene) -> dict[str, str]:
    """Return a dict from actuator, load or joint of an arm to the quantity and unit of its command."""
    labels = {each.name: f"{each.mode.value} [{each.mode.unit or 1}]" for each in scene.actuators}
    labels |= {each.name: "factor on the load [1]" for each in scene.loads}
    return labels | {joint.name: f"position of the joint [{joint.unit}]" for arm in scene.arms for joint in arm.joints}


def _vector_chart(history: RunHistory, title: str, label: str, stem: str, *, sensors: bool = False) -> Chart:
    series = {
        f"{topic.split('/')[1]} {field[-1]}": values
        for (topic, field), values in history.responses.items()
        if field.startswith(f"{stem}.") and topic.startswith("sensors/") == sensors
    }
    return _lines(history, title, label, series)


def _actuators(history: RunHistory, scene: Scene) -> list[Chart]:
    """Return a chart for each quantity that actuators and joints report, e.g. one of tensions and one of lengths."""
    reported = [
        (each.name, "Actuators", (each.mode.effort, each.mode.effort_unit), each.mode.position)
        for each in scene.actuators
    ]
    joints = [joint for arm in scene.arms for joint in arm.joints]
    reported += [(each.name, "Joints", ("effort", each.effort_unit), ("position", each.unit)) for each in joints]
    groups: dict[tuple[str, str, str], dict[str, Sequence[float]]] = {}
    for place, (name, of, *quantities) in enumerate(reported):
        for field, quantity in zip(("effort", "position"), quantities, strict=True):
            if quantity[0] and (JOINTS, f"{field}.{place}") in history.responses:
                groups.setdefault((of, *quantity), {})[name] = history.responses[JOINTS, f"{field}.{place}"]
    return [
        _lines(history, f"{of}: {name}", f"{name} [{unit or 1}]", series) for (of, name, unit), series in groups.items()
    ]


def _others(history: RunHistory) -> list[Chart]:
    """Return charts of all other published numbers; the components of a vector are in one chart."""
    charts: dict[tuple[str, str], dict[str, list[float]]] = {}
    for (topic, field), values in history.responses.items():
        if topic not in (RECORD, JOINTS, CONTACTS) and not topic.endswith(("/pose", "/wrench")):
            stem, _, part = field.rpartition(".")
            charts.setdefault((topic, stem), {})[part] = values
    counts = {field: values for (topic, field), values in history.responses.items() if topic == CONTACTS}
    found = [_lines(history, "Points in contact", "number [1]", counts)]
    for (topic, stem), series in charts.items():
        quantity = stem.rpartition(".")[2].replace("_", " ")
        label = f"{quantity} [{unit_of(f'{stem}.x') or 1}]"
        found.append(_lines(history, f"{topic.replace('/', ' ')}: {quantity}", label, series))
    return found


def _strain(history: RunHistory) -> Chart:
    times, edges, shares = history.strain.shares(BINS)
    if not times.size:
        return {"title": "", "data": [], "layout": {}}
    with np.errstate(divide="ignore"):
        shown = np.log10(100.0 * shares)
    ticks = [-2, -1, 0, 1, 2]
    heat = {
        "type": "heatmap",
        "x": numbers_of(times),
        "y": numbers_of(0.5 * (edges[1:] + edges[:-1])),
        "z": [numbers_of(row) for row in shown],
        "colorscale": "Viridis",
        "zmax": 2.0,
        "zmin": max(-2.0, float(np.log10(100.0 * shares[shares > 0.0].min()))),
        "colorbar": {
            "title": {"text": "% of the cells", "side": "right"},
            "thickness": 12,
            "tickvals": ticks,
            "ticktext": [f"{10.0**tick:g}" for tick in ticks],
        },
        "hovertemplate": "t = %{x:.4g} s, strain %{y:.4g}<extra></extra>",
    }
    return _chart("Equivalent strain over time", "equivalent strain", [heat])


def _residuals(history: RunHistory, tolerance: float) -> Chart:
    solved = np.array(history.costs["iterations"]) > 0.0
    values = np.where(solved, history.costs["error_estimate"], np.nan)
    chart = _cost(history, "Error estimate over the body's size", "[1]", {"error estimate": values})
    chart["data"] += _level(history, tolerance, "tolerance")
    chart["layout"]["yaxis"]["type"] = "log"
    return chart


def _times(history: RunHistory, dt: float) -> Chart:
    chart = _cost(history, "Solve time", "[ms]", {"solve time": 1e3 * np.array(history.costs["wall_time"])})
    if dt > 0.0:
        chart["data"] += _level(history, 1e3 * dt, "dt: slower than real time above")
    chart["layout"]["yaxis"]["type"] = "log"
    return chart


def _level(history: RunHistory, value: float, name: str) -> list[dict[str, Any]]:
    ends = [min(history.time), max(history.time)]
    line = {"color": "#6b6f76", "width": 1, "dash": "dash"}
    return [{"type": "scatter", "mode": "lines", "name": name, "x": ends, "y": [value, value], "line": line}]


def _lines(history: RunHistory, title: str, label: str, series: dict[str, Sequence[float]]) -> Chart:
    """Return a chart of series over time, thinned to every n-th step; zero or negligible series are left out.

    ``label`` is the quantity at the axis, with its unit.
    """
    stride = _stride(len(history.time))
    kept = slice(stride - 1, None, stride) if stride > 1 else slice(None)
    moving = {name: np.asarray(values, dtype=float)[kept] for name, values in series.items()}
    moving = {name: values for name, values in moving.items() if np.nanmax(np.abs(values), initial=0.0) > 0.0}
    scale = max((np.nanmax(np.abs(values)) for values in moving.values()), default=0.0)
    # A component that is only rounding noise is left out, because it would fill the legend.
    moving = {name: values for name, values in moving.items() if np.nanmax(np.abs(values)) > 1e-9 * scale}
    return _chart(title, label, _traces(np.array(history.time)[kept], moving))


def _cost(history: RunHistory, title: str, label: str, series: dict[str, Sequence[float]]) -> Chart:
    """Return a chart of costs over time, thinned to the largest value of each group of steps."""
    stride = _stride(len(history.time))
    starts = np.arange(0, len(history.time), stride)
    ends = np.minimum(starts + stride, len(history.time)) - 1
    largest = {name: np.fmax.reduceat(np.asarray(values, dtype=float), starts) for name, values in series.items()}
    return _chart(title, label, _traces(np.array(history.time)[ends], largest))


def _traces(time: NDArray[np.float64], series: dict[str, NDArray[np.float64]]) -> list[dict[str, Any]]:
    traces = []
    for place, (name, values) in enumerate(series.items()):
        line = {"color": _COLOURS[place % len(_COLOURS)], "width": 1.6}
        if name.startswith("found "):
            line |= {"dash": "dot", "width": 3, "color": _COLOURS[_AXES.index(name[-1])]}
        elif name.startswith("commanded "):
            line["color"] = _COLOURS[_AXES.index(name[-1])]
        x, y = numbers_of(time), numbers_of(values)
        traces.append({"type": "scatter", "mode": "lines", "name": name, "x": x, "y": y, "line": line})
    return traces


def _chart(title: str, label: str, data: list[dict[str, Any]]) -> Chart:
    """Return a chart. A single line has no legend; its name is in the label of the axis."""
    if len(data) == 1 and data[0].get("name", "") not in f"{title} {label}":
        label = f"{data[0]['name']} {label}".strip()
    layout = {
        "xaxis": {"title": {"text": "simulation time [s]"}},
        "yaxis": {"title": {"text": label, "standoff": 10}, "exponentformat": "power", "automargin": True},
        "showlegend": len(data) > 1,
    }
    return {"title": title, "data": data, "layout": layout}


def _select(table: dict[str, list[float]], start: str) -> dict[str, list[float]]:
    return {name.removeprefix(start): values for name, values in table.items() if name.startswith(start)}


def _stride(steps: int) -> int:
    return -(-steps // MOST_POINTS)


def numbers_of(values: Iterable[float]) -> list[float | None]:
    """Return numbers rounded to seven digits, and None for NaN and infinity, which JSON does not have."""
    return [float(f"{value:.7g}") if np.isfinite(value) else None for value in values]

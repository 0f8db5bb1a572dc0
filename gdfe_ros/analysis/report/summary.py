# SPDX-License-Identifier: Apache-2.0
"""Summary of a run, in rows for users."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.analysis.report.history import RunHistory, balance_text
from gdfe_ros.scene import Scene

Rows = list[tuple[str, str]]


def run_rows(run: BagRun, history: RunHistory) -> Rows:
    """Return rows about the outcome of the run."""
    costs = {name: np.array(values) for name, values in history.costs.items()}
    span = max(history.time) - min(history.time)
    solving = float(costs["wall_time"].sum())
    solved = costs["wall_time"][costs["iterations"] > 0]
    times = 1e3 * (solved if solved.size else costs["wall_time"])
    rows = [
        ("steps", f"{len(history.time)}, of which {int((costs['iterations'] > 0).sum())} needed a solve"),
        ("simulation time", f"{span:.6g} s"),
        ("wall time", _wall_time(run, history)),
        ("solve time", f"{solving:.4g} s, {_ratio(span, solving)}"),
        ("solve time a step", _times(times)),
        ("iterations a step", f"mean {costs['iterations'].mean():.3g}, most {costs['iterations'].max():.0f}"),
        ("largest error estimate", f"{costs['error_estimate'].max():.3g} of the body's size"),
        ("converged", _convergence(history)),
        ("least det F", f"{np.nanmin(history.responses['step_record', 'min_det']):.4g}"),
        ("balance of energy", balance_text(history)),
        ("messages", _messages(run)),
    ]
    return [(name, text) for name, text in rows if text]


def scene_rows(run: BagRun) -> Rows:
    """Return rows about the scene and the settings."""
    scene, origin = run.scene, run.reader.run
    node = origin.settings.get("node", {})
    rows = [
        ("scene", scene.name),
        ("mesh", f"{scene.mesh.n_vertices} vertices, {scene.mesh.n_cells} cells"),
        ("materials", ", ".join(f"{name} ({type(m).__name__})" for name, m in scene.materials.items())),
        *_movable(scene),
        ("policy, tolerance", f"{scene.solver.policy.value}, {scene.solver.tolerance:g}"),
    ]
    if node:
        rows.append(("clock", f"{node.get('clock')}, dt {node.get('dt')} s, deadline {node.get('deadline') or 'none'}"))
    machine = origin.machine
    libraries = [f"{key} {machine[key]}" for key in ("python", "numpy", "scipy", "numba") if key in machine]
    place = (machine.get("processor", ""), f"{machine.get('cores', '?')} cores", machine.get("platform", ""))
    return [
        *rows,
        ("bag", run.reader.path.resolve().name),
        ("scene sha256", origin.scene_sha256[:16]),
        ("gdfe_ros", origin.package_version),
        ("machine", ", ".join(place)),
        ("libraries", ", ".join(libraries)),
    ]


def _movable(scene: Scene) -> Rows:
    """Return handles, obstacles and rigid bodies, a row for each kind."""
    rows: dict[str, list[str]] = {}
    for handle in scene.handles:
        held = handle.fixed and handle.section != "bodies"  # a rigid body takes no commands, but moves
        rows.setdefault(handle.section, []).append(f"{handle.name} (fixed)" if held else handle.name)
    return [(section, ", ".join(names)) for section, names in rows.items()]


def _times(times: NDArray[np.float64]) -> str:
    median, high, most = np.percentile(times, [50, 95, 100])
    return f"median {median:.3g}, 95 % {high:.3g}, most {most:.3g} ms"


def _ratio(span: float, solving: float) -> str:
    if solving <= 0.0:
        return "nothing to solve"
    if span < solving:
        return f"{solving / span:.3g} times the simulation time" if span > 0.0 else "without simulation time"
    return f"{100.0 * solving / span:.3g} % of the simulation time"


def wall_stamped(run: BagRun) -> bool:
    """Return whether the stamps of a run are wall times: not simulation time, nor the /clock of another node."""
    node = run.reader.run.settings.get("node", {})
    return isinstance(node, dict) and not node.get("publish_clock") and node.get("clock") != "external"


def is_paced_by_wall(run: BagRun) -> bool:
    """Return whether a node made the steps of a run at a rate of wall time; only such steps can be late."""
    return wall_stamped(run) and run.reader.run.settings.get("node", {}).get("clock") == "wall"


def _wall_time(run: BagRun, history: RunHistory) -> str:
    """Return the wall time from the first to the last step, and its relation to the simulation time of these steps."""
    wall, span = history.stamps[-1] - history.stamps[0], history.simulated[-1] - history.simulated[0]
    if not wall_stamped(run) or not wall > 0.0:
        return ""
    text = f"{wall:.6g} s for {span:.6g} s of simulation time: {span / wall:.3g} of real time"
    late = float(np.max(history.lateness()))
    return f"{text}, late by up to {late:.3g} s" if is_paced_by_wall(run) and late > 0.0 else text


def _convergence(history: RunHistory) -> str:
    failed = len(history.not_converged)
    if not failed:
        return "every step"
    first = ", ".join(f"{time:.6g}" for time in history.not_converged[:5])
    cut = f"; a deadline cut {history.cut}" if history.cut else ""
    return f"all but {failed} steps{cut}; first at t = {first} s"


def _messages(run: BagRun) -> str:
    dropped = run.reader.notes.get("messages_dropped", "0")
    recovered = run.reader.notes.get("recovered_from")
    origin = f", recovered from {recovered}" if recovered else ""
    return f"{len(run.reader)}, {dropped} dropped{origin}"

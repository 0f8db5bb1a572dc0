# SPDX-License-Identifier: Apache-2.0
"""Sweeps: one scene solved with many overrides, on the workers of a cluster; their results as a table and a picture.

Results are kept in a directory. An interrupted sweep is continued with the cases that have no file there yet.
"""

from __future__ import annotations

import csv
import hashlib
import json
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from gdfe_ros.analysis.workers import run_tasks
from gdfe_ros.errors import GdfeError
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene import scene_from_text
from gdfe_ros.simulation import Simulation
from gdfe_ros.untrusted.bounded_text import LARGEST_TEXT, load_json, load_yaml
from gdfe_ros.untrusted.regular_file import read_text, replace_file

if TYPE_CHECKING:
    from distributed import Client
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Result = dict[str, Any]
_KEPT: list[Simulation] = []
"""Simulation of the worker's last case, kept because the next case reuses its factor if the matrix is the same."""
_AXES = ("fx", "fy", "fz", "mx", "my", "mz")
_FACTS = "sweep.json"


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
    """Return a dict from key to values, read from ``KEY=VALUES``: a YAML list, or ``low:high:count``.

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


def run_cases(client: Client, scene: str, cases: Sequence[Case]) -> Iterator[tuple[Case, Result]]:
    """Run cases and yield each case with the result of `run_case` when it is completed.

    If a case fails in a worker, or makes workers die, its ``status`` is ``failed``, too.

    Raises:
        GdfeError: all workers on this machine died and do not restart.
    """
    overrides = [dict(case.overrides) for case in cases]
    for number, result, error in run_tasks(client, partial(run_case, scene), overrides):
        failure = {"status": "failed", "error": f"{type(error).__name__}: {error}"}
        yield cases[number], result if error is None else failure


def run_case(scene: str, overrides: Mapping[str, Any]) -> Result:
    """Play a scene's program with overrides and return numbers about its final state.

    If the scene is invalid with these overrides, or a step raises an error, ``status`` is ``failed`` and ``error`` is
    the reason.

    Args:
        scene: YAML text that needs no other file.
        overrides: dict from dotted scene key to value.

    Returns:
        Dict from name to value. ``elapsed`` and ``cpu_time`` [s] are for the whole case, reading the scene included.
    """
    started, worked = time.perf_counter(), time.thread_time()
    result = _run(scene, overrides)
    return result | {"elapsed": time.perf_counter() - started, "cpu_time": time.thread_time() - worked}


def _run(scene: str, overrides: Mapping[str, Any]) -> Result:
    try:
        simulation = Simulation(scene_from_text(scene, origin="of the sweep", overrides=overrides))
        _KEPT[:] = [simulation]
        results = list(simulation.play())
    except (GdfeError, ValueError, ArithmeticError) as error:
        return {"status": "failed", "error": f"{type(error).__name__}: {error}"}
    return {
        "status": "converged" if all(result.converged for result in results) else "not converged",
        "error": next((result.message for result in results if not result.converged), ""),
        **_numbers(simulation, results),
    }


def _numbers(simulation: Simulation, results: list[StepResult]) -> Result:
    last, fields = results[-1], simulation.fields()
    numbers = {
        "vertices": simulation.mesh.n_vertices,
        "steps": len(results),
        "iterations": sum(result.iterations for result in results),
        "solve_time": sum(result.wall_time for result in results),
        "error_estimate": last.error_estimate,
        "energy": last.energy,
        "min_det": min(result.min_det for result in results),
        "eps_eq_max": float(fields.eps_eq.max()),
        "eps_eq_mean": float(fields.eps_eq.mean()),
    }
    for name in simulation.handle_names:
        pose = simulation.handle_pose(name)
        numbers |= {f"{name}.{axis}": float(v) for axis, v in zip("xyz", pose.translation, strict=True)}
        numbers |= {f"{name}.{axis}": float(v) for axis, v in zip(_AXES, last.reactions[name], strict=True)}
    for name, state in simulation.actuator_states().items():
        numbers |= {f"{name}.extent": state.extent, f"{name}.effort": state.effort}
    for name, position in simulation.probe_positions().items():
        numbers |= {f"{name}.{axis}": float(value) for axis, value in zip("xyz", position, strict=True)}
    return numbers


class Archive:
    """Results of a sweep on disk.

    Args:
        directory: directory of the sweep; created if it does not exist.
        scene: YAML text of the scene that the overrides of all cases change.

    Raises:
        GdfeError: the directory contains results of another scene, or files that are not of a sweep.
        OSError: the directory cannot be created.
    """

    def __init__(self, directory: Path, scene: str) -> None:
        self._cases = directory / "cases"
        facts = {"scene_sha256": hashlib.sha256(scene.encode()).hexdigest()}
        known = directory / _FACTS
        if known.is_file():
            if load_json(known.read_text(encoding="utf-8")) != facts:
                raise GdfeError(f"{directory} holds the results of another scene: name another directory or remove it")
        elif directory.exists() and any(directory.iterdir()):
            raise GdfeError(f"{directory} is not empty and holds no sweep: name another directory")
        self._cases.mkdir(parents=True, exist_ok=True)
        replace_file(known, json.dumps(facts).encode())

    def find(self, case: Case) -> Result | None:
        """Return the result of a case, or None if it is not completed."""
        path = self._cases / f"{case.name}.json"
        return load_json(path.read_text(encoding="utf-8")) if path.is_file() else None

    def keep(self, case: Case, result: Result) -> None:
        """Write a result; if the process is killed, either all of it or nothing is written."""
        replace_file(self._cases / f"{case.name}.json", json.dumps(result).encode())


SHOWN = ("energy", "eps_eq_max", "solve_time")
_LABELS = {"energy": "strain energy [J]", "eps_eq_max": "largest eps_eq", "solve_time": "solve time [s]"}


def flat_row(case: str, overrides: dict[str, Any], result: dict[str, Any]) -> Result:
    """Return a row of the table: the case, its overrides (``set.<key>``, lists as JSON text), then its result."""
    settings = {f"set.{key}": _plain(value) for key, value in overrides.items()}
    return {"case": case, **settings, **result}


def results_figure(rows: Sequence[Result], *, title: str, shown: Sequence[str] = SHOWN) -> Figure:
    """Return a figure of the ``shown`` quantities over the first varied key.

    Each combination of the other varied keys has a line. A cross marks a case that did not converge, at its last value,
    or a case that failed, at the bottom.
    """
    from matplotlib.figure import Figure  # workers need no matplotlib

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


def _draw(axes: Axes, rows: Sequence[Result], first: str, others: Sequence[str], name: str) -> None:
    numeric = all(isinstance(row.get(first), int | float) for row in rows)
    order = list(dict.fromkeys(row.get(first) for row in rows))

    def place(row: Result) -> float:
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
        from matplotlib.ticker import MaxNLocator

        axes.xaxis.set_major_locator(MaxNLocator(5))
        axes.ticklabel_format(axis="x", scilimits=(-3, 4), useMathText=True)
    else:
        axes.set_xticks(range(len(order)), [str(value)[:16] for value in order], rotation=30, ha="right", fontsize=7)
    axes.set_xlabel(first.removeprefix("set."))
    axes.set_ylabel(_LABELS.get(name, name))
    axes.grid(alpha=0.3)


def _plain(value: Any) -> Any:
    return value if isinstance(value, int | float | str | bool) else json.dumps(value)

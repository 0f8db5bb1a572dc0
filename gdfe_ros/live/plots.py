# SPDX-License-Identifier: Apache-2.0
"""Quantities of the steps over time, and their plots."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterator

import numpy as np
import viser
from numpy.typing import NDArray

from gdfe_ros.live.interface import View
from gdfe_ros.scene.scene import Scene

_LENGTH = 4096
"""Number of steps that are stored."""
_MOST = 600
"""Largest number of points of a curve. If there are more steps, only every second, third, ... step is drawn."""
_AXES = ("x", "y", "z")


class StepHistory:
    """Values of the last steps. One thread adds steps, and another one reads them.

    Args:
        scene: scene of the simulation.

    Attributes:
        curves: dict from a plot's name, its quantity with unit, to the names of its curves.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene, self._lock = scene, threading.Lock()
        self.curves: dict[str, tuple[str, ...]] = {}
        self._rows: deque[NDArray[np.float64]] = deque(maxlen=_LENGTH)

    def add(self, view: View) -> None:
        """Add a step; if its time is earlier than the last step's, after a reset, clear the history first."""
        groups = list(self._groups(view))
        row = np.array([view.record.time, *(value for _, values in groups for value in values.values())])
        with self._lock:
            self.curves = self.curves or {name: tuple(values) for name, values in groups}
            if self._rows and row[0] < self._rows[-1][0]:
                self._rows.clear()
            self._rows.append(row)

    def table(self, plot: str) -> NDArray[np.float64]:
        """Return the table (1 + c, k) of a plot: a row of times [s], then a row for each of its c curves.

        If more than `_MOST` steps are stored, only every second, third, ... step is returned.
        """
        with self._lock:
            rows = list(self._rows)
        names = list(self.curves)
        first = 1 + sum(len(self.curves[name]) for name in names[: names.index(plot)])
        columns = [0, *range(first, first + len(self.curves[plot]))]
        shown = np.array(rows[:: -(-len(rows) // _MOST)])
        return np.ascontiguousarray(shown[:, columns].T)

    def _groups(self, view: View) -> Iterator[tuple[str, dict[str, float]]]:
        record, rest = view.record, self._scene.mesh.vertices
        for name, point in self._scene.probes.items():
            moved = point.at(view.positions)[0] - point.at(rest)[0]
            yield f"{name}: displacement [m]", dict(zip(_AXES, moved, strict=True))
        for name, wrench in view.wrenches.items():
            yield f"{name}: force [N]", dict(zip(_AXES, wrench[:3], strict=True))
            yield f"{name}: moment [N m]", dict(zip(_AXES, wrench[3:], strict=True))
        for name, readings in view.actuators.items():
            for quantity, value, unit in readings:
                yield f"{name}: {quantity} [{unit or 1}]", {quantity: value}
        yield "energy [J]", {"elastic": record.energy, **record.energies}
        yield "least det F [1]", {"least det F": record.min_det}
        yield "iterations of a step [1]", {"iterations": float(record.iterations)}
        yield "time of a step [ms]", {"time": 1e3 * record.wall_time}


_COLOURS = ("#d62728", "#2ca02c", "#1f77b4", "#9467bd", "#ff7f0e", "#8c564b")
_COUNT = 2


class Plots:
    """A panel with two plots.

    Args:
        gui: controls of the page.
        history: history of the run; the quantities are known after the first step.
        below: panel below which the new panel is docked.
    """

    def __init__(self, gui: viser.GuiApi, history: StepHistory, *, below: viser.PanelHandle) -> None:
        self._gui, self._history = gui, history
        panel = gui.add_panel()
        self._tab = panel.add_tab("Plots")
        panel.dock_below(below)
        self._plots: list[_Plot] = []

    def refresh(self) -> None:
        """Draw the selected quantities."""
        if not self._plots and self._history.curves:
            names = list(self._history.curves)
            with self._tab:
                self._plots = [_Plot(self._gui, self._history, names[place]) for place in range(_COUNT)]
        for plot in self._plots:
            plot.refresh()


class _Plot:
    """A selection of quantities, and a chart with the curves of the selected quantity.

    Args:
        gui: controls of the page, in the context of the plot's container.
        history: history of the run.
        name: initially selected quantity.
    """

    def __init__(self, gui: viser.GuiApi, history: StepHistory, name: str) -> None:
        self._gui, self._history = gui, history
        self._choice = gui.add_dropdown("plot", tuple(history.curves), initial_value=name)
        self._folder = gui.add_folder(None)
        self._drawn = ""
        self._chart: viser.GuiUplotHandle | None = None

    def refresh(self) -> None:
        """Draw the curves of the selected quantity; after a new selection, replace the chart."""
        name = self._choice.value
        table = tuple(self._history.table(name))
        if name == self._drawn:
            self._chart.data = table
            return
        if self._chart is not None:
            self._chart.remove()
        curves = [
            {"label": curve, "stroke": colour, "width": 1.5}
            for curve, colour in zip(self._history.curves[name], _COLOURS, strict=False)
        ]
        with self._folder:
            self._chart = self._gui.add_uplot(
                data=table,
                series=({"label": "t [s]"}, *curves),
                scales={"x": {"time": False}},
                # Numbers such as -0.025 are cut by the usual 50 pixels.
                axes=({"label": "t [s]", "labelSize": 18, "size": 34}, {"size": 64}),
                legend={"show": True, "live": False},
                height=168,
            )
        self._drawn = name

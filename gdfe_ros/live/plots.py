# SPDX-License-Identifier: Apache-2.0
"""Plots of selected quantities over time."""

from __future__ import annotations

import viser

from gdfe_ros.live.history import StepHistory

_COLOURS = ("#d62728", "#2ca02c", "#1f77b4", "#9467bd", "#ff7f0e", "#8c564b")
_COUNT = 2


class Plots:
    """Two plots in a panel of their own.

    Args:
        gui: of the page.
        history: of the run; the quantities are known after the first step.
        below: panel below which the plots are docked.
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
    """A list of quantities, and the curves of the selected one.

    Args:
        gui: of the page, in the context of the plot's container.
        history: of the run.
        name: initial selection.
    """

    def __init__(self, gui: viser.GuiApi, history: StepHistory, name: str) -> None:
        self._gui, self._history = gui, history
        self._choice = gui.add_dropdown("plot", tuple(history.curves), initial_value=name)
        self._folder = gui.add_folder(None)
        self._drawn = ""
        self._chart: viser.GuiUplotHandle | None = None

    def refresh(self) -> None:
        """Draw the present curves; a new selection replaces the chart."""
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
                legend={"show": True, "live": False},
                height=150,
            )
        self._drawn = name

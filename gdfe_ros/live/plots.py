# SPDX-License-Identifier: Apache-2.0
"""Plots of selected quantities over time."""

from __future__ import annotations

import viser

from gdfe_ros.live.history import StepHistory

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
                axes=(
                    {"label": "t [s]", "labelSize": 18, "size": 34},
                    {"size": 64},
                ),
                legend={"show": True, "live": False},
                height=168,
            )
        self._drawn = name

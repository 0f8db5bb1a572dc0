# SPDX-License-Identifier: Apache-2.0
"""A fit as one HTML page that opens offline: values, misfits, measured and simulated curves, residuals."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray
from plotly.offline import get_plotlyjs

from gdfe_ros.analysis.report.template import fill, read_file, to_json
from gdfe_ros.fitting.curves import ComparedColumn
from gdfe_ros.fitting.fit import Fit
from gdfe_ros.fitting.fit_tables import NOT_INCLUDED, match_rows, parameter_rows
from gdfe_ros.fitting.recording import ROW

RESIDUAL = "residual: simulated - measured"
_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>@@title@@</title><link rel="icon" href="data:,"><style>@@style@@</style></head>
<body><header><h1>@@title@@</h1><p>@@description@@</p></header>
<main><div class="tables">@@tables@@</div><div id="charts"></div></main>
<script type="application/json" id="chart-data">@@charts@@</script>
<script>@@plotly@@</script>
<script>
"use strict";
const charts = JSON.parse(document.getElementById("chart-data").textContent);
const places = charts.map((chart) => {
  const section = document.createElement("section");
  const head = section.appendChild(document.createElement("h2"));
  head.textContent = chart.title;
  const place = section.appendChild(document.createElement("div"));
  place.className = "chart";
  document.getElementById("charts").appendChild(section);
  return place;
});
// Drawn once all sections are there, because each further one may make the others narrower.
const drawn = charts.map((chart, k) =>
  Plotly.newPlot(places[k], chart.data, chart.layout, {displayModeBar: false, responsive: true}));
Promise.all(drawn).then(() => { document.body.dataset.ready = "yes"; });
</script></body></html>
"""


def fit_page(fit: Fit, shown: Sequence[ComparedColumn]) -> str:
    """Return the HTML text of a fit's page; ``shown`` are the columns that have charts."""
    tables = [
        _table("Parameters", ("key", "value", "95 % interval", "correlations"), parameter_rows(fit)),
        f"<section><p>{escape(NOT_INCLUDED)}</p></section>",
        _table("Recordings", ("recording", "series", "", "values", "misfit", "of the motion"), match_rows(fit)),
    ]
    if fit.warnings:
        notes = "".join(f"<li>{escape(text)}</li>" for text in fit.warnings)
        tables.append(f"<section><h2>Warnings</h2><ul>{notes}</ul></section>")
    parts = {
        "title": escape(f"{fit.scene.name}, fitted"),
        "description": escape(fit.scene.description),
        "style": read_file("page.css"),
        "tables": "\n".join(tables),
        "charts": to_json([_chart(curve) for curve in shown]),
        "plotly": get_plotlyjs(),
    }
    return fill(_PAGE, parts)


def _table(heading: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    top = "".join(f"<th>{escape(name)}</th>" for name in head)
    body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    return f"<section><h2>{escape(heading)}</h2><table><tr>{top}</tr>{body}</table></section>"


def _chart(curve: ComparedColumn) -> dict[str, Any]:
    """Return a chart of measured and simulated values over time, with the residual below."""
    times = _list(curve.times)
    word = "predicted" if curve.held_out else "fitted"
    traces = [
        {"x": times, "y": _list(curve.measured), "name": "measured", "mode": "markers", "marker": {"size": 4}},
        {"x": times, "y": _list(curve.simulated), "name": word, "mode": "lines"},
        {"x": times, "y": _list(curve.simulated - curve.measured), "name": RESIDUAL, "yaxis": "y2", "mode": "lines"},
    ]
    unit = f" [{curve.unit}]" if curve.unit else ""
    ticks = {"tick0": 0, "dtick": max(1, len(times) // 10)} if curve.over == ROW else {}
    numbers = {"exponentformat": "e", "automargin": True}
    layout = {
        "margin": {"l": 84, "r": 10, "t": 6, "b": 40},
        "xaxis": {"anchor": "y2", "title": {"text": curve.over}} | ticks,
        "yaxis": {"domain": [0.36, 1.0], "title": {"text": f"{curve.series}{unit}", "standoff": 10}} | numbers,
        "yaxis2": {"domain": [0.0, 0.28], "title": {"text": f"residual{unit}", "standoff": 10}, "nticks": 4} | numbers,
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom"},
    }
    return {"title": f"{curve.series} of recording {curve.recording} ({word})", "data": traces, "layout": layout}


def _list(values: NDArray[np.float64]) -> list[float | None]:
    return [float(f"{value:.7g}") if np.isfinite(value) else None for value in values]

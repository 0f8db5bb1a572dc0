# SPDX-License-Identifier: Apache-2.0
"""The HTML page: everything in one file, without external resources."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from plotly.offline import get_plotlyjs

from gdfe_ros.analysis.report.summary import Rows
from gdfe_ros.analysis.report.template import fill, read_file, to_json


def build_page(
    *,
    title: str,
    description: str,
    tables: Mapping[str, Rows],
    charts: Sequence[Mapping[str, Any]],
    animation: Mapping[str, Any],
    arrays: Mapping[str, str],
    remarks: Sequence[str],
) -> str:
    """Return the HTML text of the report.

    Args:
        title: title of the page.
        description: one sentence below the title.
        tables: dict from heading to rows.
        charts: charts from ``charts.all_charts``.
        animation: description from ``Animation.to_page``.
        arrays: dict from array name to base64 text, from ``Animation.to_page``.
        remarks: one line each, e.g. about the thinning of the data.
    """
    parts = {
        "title": escape(title),
        "description": escape(description),
        "style": read_file("page.css"),
        "tables": "\n".join(_table(heading, rows) for heading, rows in tables.items()),
        "remarks": "\n".join(f"<li>{escape(text)}</li>" for text in remarks),
        "charts": to_json(charts),
        "animation": to_json(animation),
        "arrays": "\n".join(
            f'<script type="text/plain" id="{escape(name)}">{text}</script>' for name, text in arrays.items()
        ),
        "plotly": get_plotlyjs(),
        "script": read_file("surroundings.js") + read_file("page.js"),
    }
    return fill(read_file("page.html"), parts)


def _table(heading: str, rows: Rows) -> str:
    body = "".join(f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in rows)
    return f"<section><h2>{escape(heading)}</h2><table>{body}</table></section>"

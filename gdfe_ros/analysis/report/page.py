# SPDX-License-Identifier: Apache-2.0
"""The HTML page: everything in one file, without external resources."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from typing import Any

from plotly.offline import get_plotlyjs

from gdfe_ros.analysis.report.summary import Rows

_PARTS = files("gdfe_ros.analysis.report") / "page"


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
    """Return the HTML text.

    Args:
        title: of the page.
        description: one sentence below it.
        tables: rows by heading.
        charts: from ``charts.all_charts``.
        animation: description from ``Animation.to_page``.
        arrays: base64 by name, from ``Animation.to_page``.
        remarks: one line each, e.g. about the thinning of the data.
    """
    parts = {
        "title": escape(title),
        "description": escape(description),
        "style": _part("page.css"),
        "tables": "\n".join(_table(heading, rows) for heading, rows in tables.items()),
        "remarks": "\n".join(f"<li>{escape(text)}</li>" for text in remarks),
        "charts": _json(charts),
        "animation": _json(animation),
        "arrays": "\n".join(
            f'<script type="text/plain" id="{escape(name)}">{text}</script>' for name, text in arrays.items()
        ),
        "plotly": get_plotlyjs(),
        "script": _part("page.js"),
    }
    pieces = _part("page.html").split("@@")
    # Pieces alternate between text and the name of a part, so that no part is searched for the names of others.
    return "".join(parts[piece] if place % 2 else piece for place, piece in enumerate(pieces))


def _part(name: str) -> str:
    return (_PARTS / name).read_text(encoding="utf-8")


def _table(heading: str, rows: Rows) -> str:
    body = "".join(f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in rows)
    return f"<section><h2>{escape(heading)}</h2><table>{body}</table></section>"


def _json(data: Any) -> str:
    """Return JSON that is safe in a script element, whatever its text."""
    return json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")

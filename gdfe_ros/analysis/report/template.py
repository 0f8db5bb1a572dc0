# SPDX-License-Identifier: Apache-2.0
"""HTML pages of one file without external resources: filled templates, and the page of a report."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from typing import Any

from plotly.offline import get_plotlyjs

_FOLDER = files("gdfe_ros.analysis.report") / "page"


def read_file(name: str) -> str:
    """Return the text of a file that reports are made from, e.g. ``page.html``, ``page.css`` or ``page.js``."""
    return (_FOLDER / name).read_text(encoding="utf-8")


def fill(template: str, parts: Mapping[str, str]) -> str:
    """Return the template with each ``@@name@@`` replaced by its part; ``@@`` inside a part is not replaced.

    Raises:
        KeyError: a part is missing.
    """
    pieces = template.split("@@")
    return "".join(parts[piece] if place % 2 else piece for place, piece in enumerate(pieces))


def to_json(data: Any) -> str:
    """Return JSON text that is safe inside a script element."""
    return json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def build_page(
    *,
    title: str,
    description: str,
    tables: Sequence[str],
    charts: Sequence[Mapping[str, Any]],
    remarks: Sequence[str],
    animation: Mapping[str, Any] | None = None,
    arrays: Mapping[str, str] | None = None,
) -> str:
    """Return the HTML text of a report.

    Args:
        title: title of the page.
        description: one sentence below the title.
        tables: sections from `tabulate`.
        charts: charts as from ``charts.all_charts``.
        remarks: one line each, e.g. about the thinning of the data.
        animation: description from ``Animation.to_page``; None for a report without a surface.
        arrays: dict from array name to base64 text, from ``Animation.to_page``.
    """
    parts = {
        "title": escape(title),
        "description": escape(description),
        "style": read_file("page.css"),
        "tables": "\n".join(tables),
        "remarks": "\n".join(f"<li>{escape(text)}</li>" for text in remarks),
        "charts": to_json(charts),
        "animation": to_json(animation),
        "arrays": "\n".join(
            f'<script type="text/plain" id="{escape(name)}">{text}</script>' for name, text in (arrays or {}).items()
        ),
        "plotly": get_plotlyjs(),
        "script": read_file("surroundings.js") + read_file("page.js"),
    }
    return fill(read_file("page.html"), parts)


def tabulate(heading: str, rows: Sequence[Sequence[str]], head: Sequence[str] = ()) -> str:
    """Return a section with a table; without a ``head``, the first cell of each row is its heading."""
    lines = [("".join(f"<th>{escape(name)}</th>" for name in head))] if head else []
    for first, *cells in rows:
        kind = "td" if head else "th"
        lines.append(f"<{kind}>{escape(first)}</{kind}>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells))
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return f"<section><h2>{escape(heading)}</h2><table>{body}</table></section>"

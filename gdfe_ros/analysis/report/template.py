# SPDX-License-Identifier: Apache-2.0
"""HTML templates with ``@@name@@`` in place of their parts."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

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

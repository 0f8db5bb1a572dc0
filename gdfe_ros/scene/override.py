# SPDX-License-Identifier: Apache-2.0
"""Overrides of a scene file's values, by dotted key."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from gdfe_ros.errors import CommandError
from gdfe_ros.scene.document import Document, parse_value
from gdfe_ros.scene.report import Defects


def apply_override(document: Document, key: str, value: Any, report: Defects) -> None:
    """Replace a value of a document; mappings that are missing on its path are created.

    Args:
        document: the scene's data, modified in place.
        key: keys and list indices joined by dots, e.g. ``program.handles.tip.1.translation``.
        value: the value; a string is read as YAML, a numpy array or tuple becomes a list; None removes a mapping's key.
        report: collects a defect if the string is not YAML, a list lacks an index, or a single value has no keys.
    """
    parts: list[str | int] = list(key.split("."))
    try:
        value = parse_value(value) if isinstance(value, str) else _plain(value)
    except ValueError as error:
        report.add(("override", key), str(error), value=value)
        return
    current: Any = document.data
    for i, part in enumerate(parts):
        last, reached = i == len(parts) - 1, ".".join(map(str, parts[:i]))
        if isinstance(current, list):
            if not (part.isdecimal() and int(part) < len(current)):
                text = f"{reached} is a list; allowed: an index 0 to {len(current) - 1}"
                report.add(("override", key), text, value=part)
                return
            parts[i] = part = int(part)
        elif not isinstance(current, dict):
            report.add(("override", key), f"{reached} is {current!r} and has no keys")
            return
        if last and value is None and isinstance(current, dict):
            current.pop(part, None)
        elif last:
            current[part] = value
        else:
            current = current[part] if isinstance(current, list) else current.setdefault(part, {})
    document.overridden.add(tuple(parts))


def read_overrides(entries: Sequence[str], where: str = "--set") -> dict[str, str]:
    """Return a dict from key to value of entries ``key=value``; values stay text, which the scene parses as YAML.

    Raises:
        CommandError: an entry has no ``=``; ``where`` names the source of the entries in the error.
    """
    if wrong := [entry for entry in entries if "=" not in entry]:
        raise CommandError(f"{where} holds {wrong}; each entry must be key=value, e.g. solver.tolerance=1e-6")
    pairs = (entry.partition("=") for entry in entries)
    return {key.strip(): value.strip() for key, _, value in pairs}


def override_words(overrides: Mapping[str, Any]) -> list[str]:
    """Return overrides as a list of texts ``key=value`` with YAML values, for the node's ``scene_overrides``."""
    return [
        f"{key}={value if isinstance(value, str) else json.dumps(_plain(value))}" for key, value in overrides.items()
    ]


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {str(name): _plain(item) for name, item in value.items()}
    return value

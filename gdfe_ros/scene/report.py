# SPDX-License-Identifier: Apache-2.0
"""Report of a scene file's defects: key path, value, line, allowed values and remedy."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pydantic import ValidationError

from gdfe_ros.errors import SceneError
from gdfe_ros.regular_file import NAME_RULE
from gdfe_ros.scene.document import Document, KeyPath
from gdfe_ros.scene.entry import TAG
from gdfe_ros.scene.keys import describe_key, known_keys
from gdfe_ros.scene.material_schema import LAWS
from gdfe_ros.spelling import closest, did_you_mean

#: Argument ``value`` of `Defects.add` for a defect whose text shows no value.
NO_VALUE = object()
_LONGEST_VALUE = 60


class Defects:
    """Collection of defects, which are raised together in one error.

    Args:
        heading: name of the examined input, e.g. ``scene config/scenes/bend5.yaml``.
        document: the parsed file, from which values and line numbers are read.
    """

    def __init__(self, heading: str, document: Document) -> None:
        self.heading = heading
        self._document = document
        self._found: list[tuple[int, str]] = []
        self._concerned: set[KeyPath] = set()
        for path in document.duplicates:
            self.add(path, "this key is given twice; remove one of the two", value=NO_VALUE)

    def add(self, path: KeyPath, text: str, *, value: Any = None) -> None:
        """Add a defect.

        Args:
            path: keys and indices from the top level.
            text: allowed values and remedy.
            value: value to show; None for the value in the file, if this is not a mapping; `NO_VALUE` for no value.
        """
        line = self._document.line(path)
        self._concerned.add(path)
        shown = self._lookup(path) if value is None else value
        key = ".".join(map(str, path)) or "scene"
        given = "" if shown is NO_VALUE else f" = {_short(shown)}"
        where = f" (line {line})" if line else ""
        if self._document.is_overridden(path):
            where = " (override)"
        self._found.append((line or 0, f"{key}{given}{where}: {text}"))

    def add_invalid(self, error: ValidationError) -> list[KeyPath]:
        """Add every defect that pydantic found; return the key paths of these defects."""
        items = [(_keys_of(item["loc"]), item) for item in error.errors(include_url=False)]
        misspelt = {
            (*path[:-1], closest(path[-1], known_keys(item["loc"][:-1])))
            for path, item in items
            if item["type"] == "extra_forbidden"
        }
        for path, item in items:
            if not (item["type"] == "missing" and path in misspelt):
                self._add_item(item["type"], item["loc"], path, item.get("ctx", {}), item["msg"])
        return [path for path, _ in items]

    def concerns(self, key: str) -> bool:
        """Return whether a defect was found at the ``key`` of the scene or of a mesh.

        Further defects that follow from this defect need no report.
        """
        return any(key in path for path in self._concerned if path and path[0] in (key, "mesh", "meshes"))

    def raise_if_any(self) -> None:
        """Raise SceneError with every defect, in the order of the file, if there are defects."""
        if self._found:
            found = sorted(enumerate(self._found), key=lambda entry: (entry[1][0], entry[0]))
            raise SceneError(self.heading, [text for _, (_, text) in found])

    def __bool__(self) -> bool:
        return bool(self._found)

    def _add_item(self, kind: str, location: KeyPath, path: KeyPath, context: dict[str, Any], message: str) -> None:
        if kind == "missing":
            self.add(path, f"is missing; {describe_key(location)}", value=NO_VALUE)
        elif kind == "extra_forbidden":
            self.add(path, f"unknown key{suggest(path[-1], known_keys(location[:-1]))}", value=NO_VALUE)
        elif kind in ("union_tag_invalid", "union_tag_not_found"):
            self._add_law(path)
        elif location and location[-1] == "[key]":
            self.add(path, "allowed names: letters, digits and _, starting with a letter", value=NO_VALUE)
        elif path == ("name",) and kind == "string_pattern_mismatch":
            self.add(path, f"allowed: {NAME_RULE}")
        elif kind in ("literal_error", "enum"):
            allowed = context["expected"].replace(" or ", ", ").replace("'", "").split(", ")
            self.add(path, f"not known{suggest(self._lookup(path), allowed)}")
        elif kind in ("quantity", "csv", "path"):
            self.add(path, message)
        else:
            self.add(path, _plain(kind, message, location))

    def _add_law(self, path: KeyPath) -> None:
        entry = self._lookup(path, plain=False)
        if not isinstance(entry, dict):
            self.add(path, "must be a mapping, e.g. {law: linear, young: 1.0e5, poisson: 0.45}")
        elif "law" in entry:
            self.add((*path, "law"), f"unknown law{suggest(entry['law'], LAWS)}")
        else:
            self.add((*path, "law"), f"is missing; allowed: {', '.join(LAWS)}, or a preset", value=NO_VALUE)

    def _lookup(self, path: KeyPath, *, plain: bool = True) -> Any:
        value: Any = self._document.data
        for part in path:
            in_list = isinstance(value, list) and isinstance(part, int) and part < len(value)
            if not in_list and not (isinstance(value, dict) and part in value):
                return NO_VALUE
            value = value[part]
        return NO_VALUE if plain and isinstance(value, dict) else value


def suggest(given: Any, allowed: Iterable[str]) -> str:
    """Return the text ``; did you mean 'x'? allowed: ...`` for a word that is not among the allowed words."""
    words = [str(word) for word in allowed]
    return f"; {did_you_mean(str(given), words)}allowed: {', '.join(words) or 'none'}"


def _keys_of(location: KeyPath) -> KeyPath:
    """Return the key path of an error location: without the items that pydantic adds to the file's keys and indices."""
    return tuple(part for part in location if part != "[key]" and not str(part).startswith(TAG))


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 3] + "..."


def _plain(kind: str, message: str, location: KeyPath) -> str:
    if kind in ("model_type", "dict_type", "model_attributes_type"):
        keys = known_keys(location)
        return "must be a mapping (key: value)" + (f" with {', '.join(keys)}" if keys else "")
    if kind in ("tuple_type", "list_type"):
        return f"must be a list; {describe_key(location)}"
    if kind == "too_short":
        return f"must not be empty; {describe_key(location)}"
    if kind in ("string_type", "string_too_short"):
        return "must be text; put it in quotes"
    if kind in ("bool_type", "bool_parsing"):
        return "allowed: true, false"
    return message.removeprefix("Value error, ")

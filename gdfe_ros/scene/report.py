# SPDX-License-Identifier: Apache-2.0
"""Report of a scene file's defects: key path, value, line, remedy, and what the schema allows there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, Tag, ValidationError
from pydantic.fields import FieldInfo

from gdfe_ros.errors import SceneError
from gdfe_ros.regular_file import NAME_RULE
from gdfe_ros.scene.document import Document, KeyPath
from gdfe_ros.scene.entry import TAG
from gdfe_ros.scene.material_schema import LAWS
from gdfe_ros.scene.quantity import Quantity
from gdfe_ros.scene.schema import SceneModel
from gdfe_ros.spelling import closest, did_you_mean


def known_keys(location: KeyPath) -> list[str]:
    """Return the allowed keys of the mapping at a location in pydantic's form; [] if any key is allowed."""
    model = _walk(location)
    return list(model.model_fields) if _is_model(model) else []


def describe_key(location: KeyPath) -> str:
    """Return a description of the value at a location: meaning, unit and range, e.g. ``a number: duration [s] > 0``."""
    model = _walk(location[:-1])
    field = model.model_fields.get(location[-1]) if _is_model(model) else None
    if field is None:
        return "see the scene reference in docs/scene.md"
    quantity = find_quantity(field)
    if quantity is not None:
        return f"needed is {quantity.allowed}"
    if field.description:
        return f"needed: {field.description}"
    choices = get_args(field.annotation)
    return f"allowed: {', '.join(map(str, choices))}" if choices else f"needed: {field.annotation.__name__}"


def unit_of(key: str) -> str:
    """Return the unit of the number at a dotted key of a scene, e.g. ``materials.skin.young``; empty if it has none."""
    return _unit(SceneModel, key.split("."))


def _unit(annotation: Any, parts: Sequence[str]) -> str:
    """Return the unit of the number at a path below an annotation; of alternatives, the first that has the path."""
    annotation = bare(annotation)
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin in (Union, UnionType):
        return next(filter(None, (_unit(choice, parts) for choice in arguments)), "")
    if origin in (dict, list, tuple):
        return _unit(arguments[1 if origin is dict else 0], parts[1:])
    field = annotation.model_fields.get(parts[0]) if parts and _is_model(annotation) else None
    if field is None:
        return ""
    quantity = find_quantity(field)
    return quantity.unit if quantity is not None else _unit(field.annotation, parts[1:])


def find_quantity(place: FieldInfo | Any) -> Quantity | None:
    """Return the `Quantity` of a field or annotation; None if its value is not a number or a list of numbers."""
    if isinstance(place, FieldInfo):
        given = next((item for item in place.metadata if isinstance(item, Quantity)), None)
        return given or find_quantity(place.annotation)
    if get_origin(place) is Annotated:
        return next((item for item in get_args(place)[1:] if isinstance(item, Quantity)), None)
    if get_origin(place) in (Union, UnionType):
        return next(filter(None, map(find_quantity, get_args(place))), None)
    return None


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _walk(location: KeyPath) -> Any:
    current: Any = SceneModel
    for part in location:
        current = _child(current, part)
    return bare(current)


def _child(annotation: Any, part: str | int) -> Any:
    annotation = bare(annotation)
    if _is_model(annotation):
        field = annotation.model_fields.get(part)
        return field.annotation if field else None
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is dict:
        return arguments[1]
    if origin in (tuple, list):
        return arguments[0]
    if origin in (Union, UnionType):
        return next((choice for choice in arguments if _tagged(choice, part)), None)
    return None


def _tagged(annotation: Any, part: str | int) -> bool:
    return any(isinstance(item, Tag) and item.tag == part for item in getattr(annotation, "__metadata__", ()))


def bare(annotation: Any) -> Any:
    """Return the type inside of Annotated and Optional."""
    if get_origin(annotation) is Annotated:
        return bare(get_args(annotation)[0])
    if get_origin(annotation) in (Union, UnionType):
        choices = [choice for choice in get_args(annotation) if choice is not type(None)]
        return bare(choices[0]) if len(choices) == 1 else annotation
    return annotation


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

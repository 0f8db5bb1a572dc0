# SPDX-License-Identifier: Apache-2.0
"""Report of a scene file's defects: key path, value, line, remedy, and the values that the schema allows."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import MISSING, fields
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel, Tag, ValidationError
from pydantic.fields import FieldInfo

from gdfe_ros.errors import DefectsError, SceneError
from gdfe_ros.keys import FieldError, Keys, Meaning
from gdfe_ros.quantity import Quantity, find_quantity
from gdfe_ros.scene.base_entry import TAG, VALUE_ERROR
from gdfe_ros.scene.document import Document, KeyPath
from gdfe_ros.scene.schemas.material_schema import LAWS
from gdfe_ros.scene.schemas.scene_schema import SceneModel
from gdfe_ros.untrusted.regular_file import NAME_RULE
from gdfe_ros.untrusted.spelling import closest, did_you_mean


def list_keys(location: KeyPath) -> list[str]:
    """Return the allowed keys of the mapping at a location in pydantic's form; [] if any key is allowed."""
    return list(fields_of(_walk(location)))


def describe_key(location: KeyPath) -> str:
    """Return a description of the value at a location: meaning, unit and range, e.g. ``a number: duration [s] > 0``."""
    field = fields_of(_walk(location[:-1])).get(location[-1])
    if field is None:
        return "see the scene reference in docs/scene.md"
    quantity = quantity_of(field)
    if quantity is not None:
        return f"needed is {quantity.allowed}"
    if meaning := description_of(field):
        return f"needed: {meaning}"
    choices = get_args(field.annotation)
    return f"allowed: {', '.join(map(str, choices))}" if choices else f"needed: {field.annotation.__name__}"


def unit_of(key: str) -> str:
    """Return the unit of the number at a dotted key of a scene, e.g. ``materials.skin.young``; empty if it has none."""
    current: Any = SceneModel
    for part in key.split("."):
        current = _child(current, part)
        if (quantity := find_quantity(current)) is not None:
            return quantity.unit
    return ""


def quantity_of(field: FieldInfo) -> Quantity | None:
    """Return the `Quantity` of a field; None if its value is not a number or a list of numbers."""
    given = next((item for item in field.metadata if isinstance(item, Quantity)), None)
    return given or find_quantity(field.annotation)


def description_of(field: FieldInfo) -> str | None:
    """Return the description of a field, or its `Meaning`; None if it has none."""
    return field.description or next((item.text for item in field.metadata if isinstance(item, Meaning)), None)


def fields_of(kind: Any) -> dict[str, FieldInfo]:
    """Return a dict from name to each field of a kind of entry, a model or a dataclass; empty for another type."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return kind.model_fields
    if not (isinstance(kind, type) and issubclass(kind, Keys)):
        return {}
    hints = get_type_hints(kind, include_extras=True)
    return {
        item.name: FieldInfo.from_annotation(hints[item.name])
        if item.default is MISSING
        else FieldInfo.from_annotated_attribute(hints[item.name], item.default)
        for item in fields(kind)
    }


def _walk(location: KeyPath) -> Any:
    current: Any = SceneModel
    for part in location:
        current = _child(current, part)
    return bare(current)


def _child(annotation: Any, part: str | int) -> Any:
    """Return the annotation of the item at a key, an index or a tag of an annotation; None if there is no such item."""
    annotation = bare(annotation)
    if known := fields_of(annotation):
        if (field := known.get(part)) is None:
            return None
        return Annotated[(field.annotation, *field.metadata)] if field.metadata else field.annotation
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin in (dict, list, tuple):
        return arguments[1 if origin is dict else 0]
    if origin in (Union, UnionType):
        tagged = (choice for choice in arguments if _has_tag(choice, part))
        return next(tagged, None) or next(filter(None, (_child(choice, part) for choice in arguments)), None)
    return None


def _has_tag(annotation: Any, part: str | int) -> bool:
    return any(isinstance(item, Tag) and item.tag == part for item in getattr(annotation, "__metadata__", ()))


def bare(annotation: Any) -> Any:
    """Return the type inside of Annotated and Optional."""
    if get_origin(annotation) is Annotated:
        return bare(get_args(annotation)[0])
    if get_origin(annotation) in (Union, UnionType):
        choices = [choice for choice in get_args(annotation) if choice is not type(None)]
        return bare(choices[0]) if len(choices) == 1 else annotation
    return annotation


#: Argument ``value`` of `Defects.add` for a message without the value in the file.
NO_VALUE = object()
#: Argument ``value`` of `Defects.add` for a message with the value in the file, even if it is a mapping.
WHOLE = object()
_LONGEST_VALUE = 60
_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")
"""Kinds of pydantic's errors for a key that a model or a dataclass does not have."""


class Unfit(Exception):
    """An entry does not fit the rest of the scene.

    Args:
        key: key of the defect below the entry, with dots between keys; empty for the entry itself.
        texts: each defect, with allowed values and remedy.
        value: as for `Defects.add`.
    """

    def __init__(self, key: str, *texts: str, value: Any = None) -> None:
        super().__init__(key, *texts)
        self.key, self.texts, self.value = key, texts, value


def require_known(key: str, noun: str, name: str, known: Collection[str]) -> None:
    """Raise `Unfit` with the ``known`` names if a name is not among them."""
    if name not in known:
        raise Unfit(key, f"there is no such {noun}{suggest(name, known)}")


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
            self.refuse(path, "this key is given twice; remove one of the two")

    def add(self, path: KeyPath, text: str, *, value: Any = None) -> None:
        """Add a defect.

        Args:
            path: keys and indices from the top level.
            text: allowed values and remedy.
            value: value to show; None for the value in the file, if this is not a mapping; `WHOLE` for any value in the
                file; `NO_VALUE` for no value.
        """
        line = self._document.line(path)
        self._concerned.add(path)
        shown = self.value_at(path, plain=value is None) if value in (None, WHOLE) else value
        key = ".".join(map(str, path)) or "scene"
        given = "" if shown is NO_VALUE else f" = {_short(shown)}"
        where = f" (line {line})" if line else ""
        if self._document.is_overridden(path):
            where = " (override)"
        self._found.append((line or 0, f"{key}{given}{where}: {text}"))

    def refuse(self, path: KeyPath, text: str) -> None:
        """Add a defect whose text shows no value."""
        self.add(path, text, value=NO_VALUE)

    def add_all(self, path: KeyPath, error: DefectsError) -> None:
        """Add every defect of an error at one key path."""
        for defect in error.defects:
            self.add(path, defect)

    @contextmanager
    def entry(self, *path: str | int) -> Iterator[None]:
        """Catch `Unfit` in the ``with`` block, and add its defects; execution continues after the block."""
        try:
            yield
        except Unfit as error:
            for text in error.texts:
                self.add((*path, *filter(None, error.key.split("."))), text, value=error.value)

    def names(self, section: str) -> list[str]:
        """Return the names of all entries of a section of the file, with and without defects."""
        entries = self._document.data.get(section)
        return [str(name) for name in entries] if isinstance(entries, dict) else []

    def add_invalid(self, error: ValidationError) -> list[KeyPath]:
        """Add every defect that pydantic found; return the key paths of these defects."""
        items = [(_keys_of(item["loc"]), item) for item in error.errors(include_url=False)]
        misspelt = {
            (*path[:-1], closest(path[-1], list_keys(item["loc"][:-1])))
            for path, item in items
            if item["type"] in _UNKNOWN
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

    def _add_item(self, kind: str, location: KeyPath, path: KeyPath, context: dict[str, Any], message: str) -> None:
        if kind == "missing":
            self.refuse(path, f"is missing; {describe_key(location)}")
        elif kind in _UNKNOWN:
            self.refuse(path, f"unknown key{suggest(path[-1], list_keys(location[:-1]))}")
        elif kind in ("union_tag_invalid", "union_tag_not_found"):
            self._add_law(path)
        elif location and location[-1] == "[key]":
            self.refuse(path, "allowed names: letters, digits and _, starting with a letter")
        elif path == ("name",) and kind == "string_pattern_mismatch":
            self.add(path, f"allowed: {NAME_RULE}")
        elif kind in ("literal_error", "enum"):
            allowed = context["expected"].replace(" or ", ", ").replace("'", "").split(", ")
            self.add(path, f"not known{suggest(self.value_at(path), allowed)}")
        elif isinstance(context.get("error"), FieldError):
            self.add((*path, context["error"].field), context["error"].text)
        else:
            self.add(path, _plain(kind, message, location))

    def _add_law(self, path: KeyPath) -> None:
        entry = self.value_at(path, plain=False)
        if not isinstance(entry, dict):
            self.add(path, "must be a mapping, e.g. {law: linear, young: 1.0e5, poisson: 0.45}")
        elif "law" in entry:
            self.add((*path, "law"), f"unknown law{suggest(entry['law'], LAWS)}")
        else:
            self.refuse((*path, "law"), f"is missing; allowed: {', '.join(LAWS)}, or a preset")

    def value_at(self, path: KeyPath, *, plain: bool = True) -> Any:
        """Return the value in the file at a key path; `NO_VALUE` if there is none, or for a mapping if ``plain``."""
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
    """Return the key path of a pydantic error location, without pydantic's additions to the file's keys and indices."""
    return tuple(part for part in location if part != "[key]" and not str(part).startswith(TAG))


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 3] + "..."


def _plain(kind: str, message: str, location: KeyPath) -> str:
    if kind in ("model_type", "dict_type", "dataclass_type"):
        keys = list_keys(location)
        return "must be a mapping (key: value)" + (f" with {', '.join(keys)}" if keys else "")
    if kind in ("tuple_type", "list_type"):
        return f"must be a list; {describe_key(location)}"
    if kind == "too_short":
        return f"must not be empty; {describe_key(location)}"
    if kind in ("string_type", "string_too_short"):
        return "must be text; put it in quotes"
    if kind in ("bool_type", "bool_parsing"):
        return "allowed: true, false"
    return message.removeprefix(VALUE_ERROR)

# SPDX-License-Identifier: Apache-2.0
"""Lookup of the keys of a scene file by their location."""

from __future__ import annotations

from collections.abc import Sequence
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, Tag
from pydantic.fields import FieldInfo

from gdfe_ros.scene.document import KeyPath
from gdfe_ros.scene.quantity import Quantity
from gdfe_ros.scene.schema import SceneModel


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

# SPDX-License-Identifier: Apache-2.0
"""Conversion of ROS messages to YAML and back: ``{pose: {position: {z: 0.1}}}``."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import yaml

from gdfe_ros.analysis.message_values import cloud_kind
from gdfe_ros.errors import GdfeError
from gdfe_ros.node.middleware.ros_types import interface_class
from gdfe_ros.untrusted.bounded_text import load_yaml, plain_lines
from gdfe_ros.untrusted.real_number import is_number
from gdfe_ros.untrusted.spelling import did_you_mean

MOST_SHOWN = 16
"""Largest number of shown values of an array. A longer array is shown by its first values and its length."""
_LONGEST_SHOWN = 200
"""Largest number of characters of a text that an error shows."""
_ARRAY = re.compile(r"sequence<(?P<kind>[^,]+)(, \d+)?>|(?P<fixed>.+)\[(?P<count>\d+)\]")
_TEXT = re.compile(r"w?string(<\d+>)?")


def parse(text: str) -> object:
    """Parse YAML from the command line.

    Raises:
        GdfeError: the text is not YAML.
    """
    try:
        return load_yaml(text)
    except yaml.YAMLError as error:
        problem = getattr(error, "problem", None) or error
        raise GdfeError(
            f"{text[:_LONGEST_SHOWN]!r} is no YAML: {problem}; write e.g. '{{name: [flexor], effort: [4.0]}}'"
        ) from None


def fill(message: Any, values: object, where: str = "") -> Any:
    """Set fields of a message from nested mappings and lists, and return it; other fields keep their defaults.

    Args:
        message: message of any type.
        values: mapping from field name to value.
        where: path of this message inside the outermost message, for error texts.

    Raises:
        GdfeError: a field does not exist, or a value has the wrong type.
    """
    fields = message.get_fields_and_field_types()
    if not isinstance(values, Mapping):
        name = where or type(message).__name__
        raise GdfeError(f"{name} needs a mapping of fields, e.g. {{{next(iter(fields), '')}: ...}}; got {values!r}")
    for name, value in values.items():
        path = f"{where}.{name}".lstrip(".")
        if name not in fields:
            raise GdfeError(f"no field {path!r}; {did_you_mean(str(name), fields)}fields: {', '.join(fields)}")
        setattr(message, name, _convert(fields[name], value, path, getattr(message, name)))
    return message


def show(message: Any) -> str:
    """Return a message as YAML, with long arrays truncated and control characters escaped."""
    text = yaml.safe_dump(_plain(message), sort_keys=False, allow_unicode=True, default_flow_style=None)
    return plain_lines(text.rstrip())


def _convert(kind: str, value: object, path: str, present: Any) -> Any:
    """Return a value converted to a field's ROS type."""
    if found := _ARRAY.fullmatch(kind):
        if not isinstance(value, Sequence) or isinstance(value, str):
            raise GdfeError(f"{path} takes a list of {found['kind'] or found['fixed']}, got {value!r}")
        if found["count"] and len(value) != int(found["count"]):
            raise GdfeError(f"{path} takes {found['count']} values, got {len(value)}")
        element = found["kind"] or found["fixed"]
        return [_convert(element, item, f"{path}[{place}]", None) for place, item in enumerate(value)]
    if "/" in kind:
        package, name = kind.split("/")
        return fill(interface_class(f"{package}/msg/{name}")() if present is None else present, value, path)
    return _check(kind, value, path)


def _check(kind: str, value: object, path: str) -> Any:
    """Check a value of a primitive ROS type, and return it converted to the type of the message's field."""
    convert: Callable[[Any], Any]
    if _TEXT.fullmatch(kind):
        good, convert = isinstance(value, str), str
    elif kind == "boolean":
        good, convert = isinstance(value, bool), bool
    elif kind in ("double", "float"):
        good, convert = _is_number(value), float
    elif kind in ("octet", "byte"):
        good, convert = isinstance(value, int) and 0 <= value < 256, lambda number: bytes([number])
    else:
        limits = np.iinfo(kind if kind != "char" else "uint8")
        good = is_number(value, int) and limits.min <= value <= limits.max
        convert = int
    if not good:
        raise GdfeError(f"{path} takes a {kind}, got {value!r}")
    return convert(value)


def _is_number(value: object) -> bool:
    """Return whether a value is a number or the text of a number, because YAML reads 1e5 as text."""
    if isinstance(value, str):
        try:
            float(value)
        except ValueError:
            return False
        return True
    return is_number(value)


def _plain(value: Any) -> Any:
    """Return a message or a field's value in types that YAML can write."""
    if hasattr(value, "get_fields_and_field_types"):
        fields = {name: _plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
        return fields if (points := _points(value)) is None else {"header": fields["header"], "points": points}
    if isinstance(value, bytes):
        return int.from_bytes(value, "little")
    if isinstance(value, str | bool | int | float):
        return value
    if isinstance(value, np.generic):
        return value.item()
    shown = [_plain(item) for item in value[:MOST_SHOWN]]
    return shown if len(value) <= MOST_SHOWN else [*shown, f"... {len(value)} values"]


def _points(message: Any) -> list[Any] | None:
    """Return the points of a cloud as mappings from field to number; None for another message, or a defective cloud."""
    if type(message).__name__ != "PointCloud2" or any(field.count != 1 for field in message.fields):
        return None
    size, count = message.row_step, message.width * message.height
    try:
        kind = cloud_kind(message)
    except (KeyError, ValueError):
        return None
    if size != message.width * message.point_step or len(message.data) < message.height * size:
        return None
    points = np.frombuffer(bytes(message.data), kind, min(count, MOST_SHOWN))
    shown = [{name: _round(point[name]) for name in kind.names} for point in points]
    return shown if count <= MOST_SHOWN else [*shown, f"... {count} points"]


def _round(number: Any) -> Any:
    """Return a number of a cloud in YAML's types; single precision has seven digits."""
    return float(f"{number:.7g}") if number.dtype.kind == "f" else number.item()

# SPDX-License-Identifier: Apache-2.0
"""Quantities in messages of any type: by a path such as ``rigid_bodies[0].pose.position``, and as numbers."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from gdfe_ros.errors import GdfeError
from gdfe_ros.spelling import did_you_mean

_STEP = re.compile(r"\.?([A-Za-z_]\w*)|\[(-?\d+)\]|\[([A-Za-z_]\w*)=([^\]]*)\]")
_HOLDERS = ("pose", "transform", "wrench")
_PLACES = (("position", "orientation"), ("translation", "rotation"))


def follow(message: Any, path: str) -> Any:
    """Return the value at a path in a message; None if the message has no such item of a sequence.

    Args:
        message: the message.
        path: names of fields, separated by points; ``[k]`` is the k-th item of a sequence, from 0, and ``[name=text]``
            the first item whose field ``name`` is ``text``.

    Raises:
        GdfeError: the path is no such text, or a message has no such field.
    """
    value, place = message, 0
    while place < len(path):
        step = _STEP.match(path, place)
        if step is None:
            raise GdfeError(f"path {path!r}: {path[place:]!r} is no field, [index] or [field=text]")
        field, index, key, text = step.groups()
        if field is not None:
            value = _field(value, field, path)
        elif index is not None:
            items = _items(value, path)
            if not -len(items) <= int(index) < len(items):
                return None
            value = items[int(index)]
        else:
            value = next((item for item in _items(value, path) if str(_field(item, key, path)) == text), None)
            if value is None:
                return None
        place = step.end()
    return value


def vector_of(part: Any, *, pose: bool) -> list[float] | None:
    """Return the numbers of a number, point, vector, pose, transform or wrench; None for any other value.

    Args:
        part: a message, or a value in it. Poses with a stamp or a covariance are poses.
        pose: whether poses have their rotation vectors, too.
    """
    if isinstance(part, int | float | np.number):
        return [float(part)]
    if isinstance(part, np.ndarray) and part.ndim == 1 and len(part) in (1, 3):
        return part.astype(float).tolist()
    for place, turn in _PLACES:
        if hasattr(part, place) and hasattr(part, turn):
            point = getattr(part, place)
            return [point.x, point.y, point.z, *(_turn(getattr(part, turn)) if pose else [])]
    for name in (*_HOLDERS, "point", "vector", "force"):
        if hasattr(part, name):
            return vector_of(getattr(part, name), pose=pose)
    if all(hasattr(part, axis) for axis in "xyz") and not hasattr(part, "w"):
        return [part.x, part.y, part.z]
    return None


def _field(value: Any, name: str, path: str) -> Any:
    known = [key for key in getattr(value, "__dataclass_fields__", {}) if not key.startswith("_")]
    if name not in known:
        hint = did_you_mean(name, known)
        raise GdfeError(f"path {path!r}: there is no field {name!r}; {hint}fields: {', '.join(known) or 'none'}")
    return getattr(value, name)


def _items(value: Any, path: str) -> Any:
    if not isinstance(value, list | tuple | np.ndarray):
        raise GdfeError(f"path {path!r}: [...] belongs to a sequence, but this is {type(value).__name__}")
    return value


def _turn(orientation: Any) -> list[float]:
    quaternion = [orientation.x, orientation.y, orientation.z, orientation.w]
    return list(Rotation.from_quat(quaternion).as_rotvec()) if any(quaternion) else [0.0, 0.0, 0.0]

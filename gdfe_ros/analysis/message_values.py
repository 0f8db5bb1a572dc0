# SPDX-License-Identifier: Apache-2.0
"""Conversion of a decoded message to named arrays of numbers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.recording.step import StepRecord

Values = dict[str, NDArray[Any]]
"""Dict from field name, e.g. ``eps_eq`` or ``wrench.force.x``, to array (k,), of one message."""

RECORD_FIELDS = ("converged", "iterations", "substeps", "error_estimate", "energy", "min_det")
"""Fields of a step record that are equal in two equal runs; wall times and texts are left out."""

_DESCRIPTION = frozenset({"header", "layout", "__msgtype__"})
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


def message_values(message: Any) -> Values:
    """Return the numbers of a message decoded by ``array_decoder``.

    The columns of a PointCloud2 have the names of its fields. Numbers of nested messages have their dotted path as
    name. Headers, layouts, covariances and texts are left out.
    """
    if hasattr(message, "point_step"):
        return cloud_values(message)
    return dict(_leaves("", message))


def cloud_values(cloud: Any) -> Values:
    """Return the columns of a PointCloud2: for each field an array (width,) of the field's type."""
    kind = cloud_kind(cloud)
    table = np.frombuffer(cloud.data.tobytes(), dtype=kind)
    return {name: np.ascontiguousarray(table[name]) for name in kind.names}


def cloud_kind(cloud: Any) -> np.dtype:
    """Return numpy's type of the points of a PointCloud2.

    Raises:
        KeyError, ValueError: a type is unknown, a field ends beyond the point, or two have one name.
    """
    order = ">" if cloud.is_bigendian else "<"
    return np.dtype(
        {
            "names": [field.name for field in cloud.fields],
            "formats": [order + _TYPES[field.datatype] for field in cloud.fields],
            "offsets": [field.offset for field in cloud.fields],
            "itemsize": cloud.point_step,
        }
    )


def record_values(record: StepRecord) -> Values:
    """Return the numbers of a step record that a replay must reproduce, (1,) each."""
    values = {name: np.array([getattr(record, name)], dtype=float) for name in RECORD_FIELDS}
    parts = {f"skipped.{name}": count for name, count in record.skipped.items()}
    parts |= {f"energies.{name}": value for name, value in record.energies.items()}
    return values | {name: np.array([value], dtype=float) for name, value in parts.items()}


def _leaves(path: str, value: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    if isinstance(value, np.ndarray):
        yield path, value
    elif isinstance(value, (bool, int, float)):
        yield path, np.array([value])
    elif isinstance(value, list):
        for place, item in enumerate(value):
            yield from _leaves(f"{path}.{place}", item)
    elif hasattr(value, "__dataclass_fields__"):
        for name in value.__dataclass_fields__:
            if name not in _DESCRIPTION and not name.endswith("_covariance"):
                yield from _leaves(f"{path}.{name}" if path else name, getattr(value, name))

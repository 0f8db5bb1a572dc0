# SPDX-License-Identifier: Apache-2.0
"""Checks of the numbers in a message."""

from __future__ import annotations

import math

from gdfe_ros.node.refusals import Reason, Refusal


def require_finite(**vectors: tuple[float, ...]) -> None:
    """Raise a `Refusal` that shows all vectors by name if any number in them is not finite."""
    if not all(math.isfinite(value) for vector in vectors.values() for value in vector):
        given = " and ".join(f"{name} {vector}" for name, vector in vectors.items())
        raise Refusal(Reason.NOT_FINITE, f"{given} must be finite numbers")


def require_unit(slack: float, **quaternion: tuple[float, float, float, float]) -> None:
    """Raise a `Refusal` that shows the named quaternion (x, y, z, w) if its length is not 1 within ``slack``."""
    ((name, value),) = quaternion.items()
    length = math.hypot(*value)
    if abs(length - 1.0) > slack:
        text = f"{name} (x, y, z, w) {value} has length {length:.6g}; allowed: 1 +- {slack:g}"
        raise Refusal(Reason.NOT_UNIT, text)

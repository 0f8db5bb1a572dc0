# SPDX-License-Identifier: Apache-2.0
"""Checks of numbers in inputs."""

from __future__ import annotations

import math
import numbers


def is_number(value: object, kind: type = numbers.Real) -> bool:
    """Return whether a value is a number of the given kind. True and False are no numbers, unlike in Python."""
    return isinstance(value, kind) and not isinstance(value, bool)


def is_finite(value: numbers.Real) -> bool:
    """Return whether a number is finite in double precision."""
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond the range of double precision
        return False

# SPDX-License-Identifier: Apache-2.0
"""What counts as a number where one is given."""

from __future__ import annotations

import math
import numbers


def is_number(value: object, kind: type = numbers.Real) -> bool:
    """Tell whether it is a number of a kind; True and False are none, though Python counts with them."""
    return isinstance(value, kind) and not isinstance(value, bool)


def is_finite(value: numbers.Real) -> bool:
    """Tell whether a number is finite in double precision."""
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond all that double precision can hold
        return False

# SPDX-License-Identifier: Apache-2.0
"""Checks of numbers in inputs."""

from __future__ import annotations

import math
import numbers

from gdfe_ros.errors import CommandError, RangeError


def is_number(value: object, kind: type = numbers.Real) -> bool:
    """Return whether a value is a number of the given kind. True and False are no numbers, unlike in Python."""
    return isinstance(value, kind) and not isinstance(value, bool)


def is_finite(value: numbers.Real) -> bool:
    """Return whether a number is finite in double precision."""
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond the range of double precision
        return False


def require_command(
    what: str, value: object, *, low: float = -math.inf, high: float = math.inf, unit: str = "", remedy: str = ""
) -> float:
    """Return a command, after a check that it is a finite number from ``low`` to ``high``.

    Args:
        what: name of the command, e.g. ``joint 'lift': position``, with which the message of an error begins.
        value: given command.
        low: least command, in ``unit``.
        high: largest command, in ``unit``.
        unit: SI unit, for the message.
        remedy: end of the message about a number out of the range.

    Raises:
        CommandError: the command is no finite number.
        RangeError: it is out of the range.
    """
    allowed = "" if low == -math.inf and high == math.inf else f"{low:g} to {high:g} {unit}".rstrip()
    if not is_number(value) or not is_finite(value):
        wrong = "is not finite" if is_number(value) else "is no number"
        raise CommandError(f"{what} {value!r} {wrong}; allowed: {', '.join(filter(None, ('finite numbers', allowed)))}")
    if not low <= value <= high:
        raise RangeError(f"{what} {value!r}; allowed: {'; '.join(filter(None, (allowed, remedy)))}")
    return float(value)

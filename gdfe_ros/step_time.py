# SPDX-License-Identifier: Apache-2.0
"""Limits of a step's duration, in simulation time and wall time."""

from __future__ import annotations

import numbers

from gdfe_ros.errors import CommandError
from gdfe_ros.real_number import is_finite, is_number

LONGEST = 1e9
"""Longest duration of a step and longest deadline [s]."""
MOST_STEPS = 100_000
"""Largest number of internal steps into which one step of a body with mass may be divided."""


def require_times(*, dt: object, deadline: object, cut_after: object) -> float:
    """Check the duration ``dt`` [s] of a step, and its limits ``deadline`` [s] and ``cut_after``; None means no limit.

    Returns:
        ``dt`` in double precision. In lower precision, the sum of many time steps stops growing.

    Raises:
        CommandError: a time is not finite, below zero or above `LONGEST`, or ``cut_after`` is negative or not a whole
            number.
    """
    for name, value in (("dt", dt), ("deadline", 0.0 if deadline is None else deadline)):
        if not (is_number(value) and is_finite(value) and 0.0 <= value <= LONGEST):
            raise CommandError(f"{name} is {value!r}; allowed: finite, 0 to {LONGEST:g} [s]")
    if cut_after is not None and not (is_number(cut_after, numbers.Integral) and cut_after >= 0):
        raise CommandError(f"cut_after is {cut_after!r}; allowed: whole numbers, 0 or more")
    return float(dt)


def require_countable(*, dt: float, step: float) -> None:
    """Check that ``dt`` [s] has at most `MOST_STEPS` internal steps of ``step`` [s].

    Raises:
        CommandError: ``dt`` has more internal steps.
    """
    if dt > MOST_STEPS * step:
        raise CommandError(
            f"dt is {dt!r}, {dt / step:.3g} internal steps of {step:g} s (dynamics.step); allowed: 0 to "
            f"{MOST_STEPS * step:g} s, {MOST_STEPS} internal steps; remedy: make several steps"
        )

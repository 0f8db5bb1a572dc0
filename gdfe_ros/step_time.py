# SPDX-License-Identifier: Apache-2.0
"""How long a step may be, in simulation and wall time."""

from __future__ import annotations

import numbers

from gdfe_ros.errors import CommandError
from gdfe_ros.real_number import is_finite, is_number

LONGEST = 1e9
"""Longest time of a step and longest deadline [s]."""
MOST_STEPS = 100_000
"""Internal steps of a body with mass that one step may be cut into."""


def require_times(*, dt: object, deadline: object, cut_after: object) -> float:
    """Refuse what is no time: ``dt`` and ``deadline`` [s], or no count; None is no deadline, and no count.

    Returns:
        ``dt`` in double precision: times that are summed up in less stand still.

    Raises:
        CommandError: it is no finite number, below zero, or above `LONGEST`.
    """
    for name, value in (("dt", dt), ("deadline", 0.0 if deadline is None else deadline)):
        if not (is_number(value) and is_finite(value) and 0.0 <= value <= LONGEST):
            raise CommandError(f"{name} is {value!r}; allowed: finite, 0 to {LONGEST:g} [s]")
    if cut_after is not None and not (is_number(cut_after, numbers.Integral) and cut_after >= 0):
        raise CommandError(f"cut_after is {cut_after!r}; allowed: whole numbers, 0 or more")
    return float(dt)


def require_countable(*, dt: float, step: float) -> None:
    """Refuse a time ``dt`` [s] that takes more than `MOST_STEPS` internal steps of at most ``step`` [s].

    Raises:
        CommandError: it takes more.
    """
    if dt > MOST_STEPS * step:
        raise CommandError(
            f"dt is {dt!r}, {dt / step:.3g} internal steps of {step:g} s (dynamics.step); allowed: 0 to "
            f"{MOST_STEPS * step:g} s, {MOST_STEPS} internal steps; remedy: several steps one after another"
        )

# SPDX-License-Identifier: Apache-2.0
"""Whether what a solve found is an equilibrium, and in words what is wrong where it is none."""

from __future__ import annotations

import math

MOST_UPDATES = 60
"""Of pressures, multipliers and scales in one solve; what has not settled by then swings."""
TOO_DEEP = "what was apart came so deep into each other that it would not be kept apart"


def verdict(
    *, residual: float, tolerance: float, settled: bool, stopped: str, last: float, flaw: str, hopeless: bool
) -> tuple[bool, float, str]:
    """Return whether it is an equilibrium, the estimated distance to it over the body's size, and what is wrong.

    Args:
        residual: that distance, as the descent knows it.
        tolerance: that is asked for.
        settled: pressures, multipliers and scales have settled.
        stopped: what ended it before its time; empty for nothing.
        last: length of the last step over the body's size.
        flaw: why it cannot stand all the same; empty where it can.
        hopeless: what was apart would not be kept apart.
    """
    if hopeless:
        return False, math.inf, "; ".join(filter(None, (flaw, TOO_DEEP)))
    converged, known, message = _unflawed(residual, tolerance, settled, stopped, last)
    return converged and not flaw, known, "; ".join(filter(None, (flaw, message)))


def _unflawed(residual: float, tolerance: float, settled: bool, stopped: str, last: float) -> tuple[bool, float, str]:
    if residual <= tolerance and settled:
        return True, residual, ""
    if stopped:
        text = f"{stopped}: how far from equilibrium is not known yet, the last step was {last:.3g} of the body's size"
        return False, math.inf, f"{text}; the next step goes on from here"
    if residual <= tolerance:
        text = "pressures, commanded lengths and volumes, or hourglass scales have not settled"
        return False, residual, f"{text} in {MOST_UPDATES} updates, though the positions hardly move any more"
    if not math.isfinite(residual):
        text = "how far from equilibrium is not known: the body is at the edge of its stability"
        return False, residual, f"{text}; smaller steps, or other commands, lead past it"
    text = f"about {residual:.3g} of the body's size from equilibrium, tolerance {tolerance:.3g}"
    return False, residual, f"no further descent is possible at the precision of the energy: {text}"

# SPDX-License-Identifier: Apache-2.0
"""Units of length of mesh files: a guess of the unit, and a defect if metres are implausible."""

from __future__ import annotations

import math
from collections.abc import Mapping

#: Diagonal [m] above which a soft body counts as given in another unit, unless the scene states a scale.
LONGEST = 3.0
#: Diagonal [m] below which a soft body counts as given in another unit, unless the scene states a scale.
SHORTEST = 1e-4
#: Usual units of mesh files and their size in metres.
UNITS: Mapping[str, float] = {"m": 1.0, "cm": 0.01, "inch": 0.0254, "mm": 0.001, "um": 1e-6}


def guess_unit(size: float) -> str:
    """Return the unit (m, mm or um) in which a body with this diagonal is closest in size to a hand, 0.1 m.

    Args:
        size: bounding-box diagonal in the file's own unit, > 0.
    """
    return min(("m", "mm", "um"), key=lambda unit: abs(math.log10(size * UNITS[unit] / 0.1)))


def unit_defects(size: float, scale: float | None) -> list[str]:
    """Return a list with one defect if no scale was stated and the size in metres is implausible; empty otherwise.

    Args:
        size: bounding-box diagonal in the file's own unit.
        scale: metres for each unit of the file as stated by the user; None if not stated.
    """
    if scale is not None or not math.isfinite(size) or size == 0.0 or SHORTEST <= size <= LONGEST:
        return []
    unit = guess_unit(size)
    plausible = unit != "m" and SHORTEST <= size * UNITS[unit] <= LONGEST
    advice = f"it seems to be in {unit}: give `scale: {UNITS[unit]:g}`" if plausible else "check its unit"
    return [
        f"the body's diagonal is {size:g}, which is not in metres for a soft robot (allowed without `scale`: "
        f"{SHORTEST:g} to {LONGEST:g} m); remedy: {advice}, or `scale: 1.0` if it is in metres"
    ]

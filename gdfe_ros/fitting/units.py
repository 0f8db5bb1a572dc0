# SPDX-License-Identifier: Apache-2.0
"""Units of measured columns, as factors to SI."""

from __future__ import annotations

from typing import Literal

FACTORS = {
    "m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254,
    "N": 1.0, "mN": 1e-3, "gf": 9.80665e-3, "kgf": 9.80665,
    "Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "mbar": 1e2, "bar": 1e5, "psi": 6894.757293168,
    "m^3": 1.0, "l": 1e-3, "ml": 1e-6,
    "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9,
    "1": 1.0,
}  # fmt: skip
"""Dict from unit to its value in SI units."""
Unit = Literal[
    "m", "cm", "mm", "um", "in", "N", "mN", "gf", "kgf", "Pa", "kPa", "MPa", "mbar", "bar", "psi", "m^3", "l", "ml",
    "s", "ms", "us", "ns", "1",
]  # fmt: skip

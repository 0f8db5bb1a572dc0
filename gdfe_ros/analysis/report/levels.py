# SPDX-License-Identifier: Apache-2.0
"""Numbers as 16-bit levels, and arrays as text, for an HTML page."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

_LEVELS = 65535


def to_levels(
    values: NDArray[np.floating[Any]], *, least_span: float = 0.0
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.uint16]]:
    """Quantise each column of ``values`` (k, c) to 16-bit levels between its least and its largest value.

    If a column spans less than ``least_span``, its largest value is raised to this span.

    Returns:
        Least values (c,), largest values (c,), and levels (k, c).
    """
    finite = np.where(np.isfinite(values), values, np.nan)
    low = np.nan_to_num(np.nanmin(finite, axis=0)).astype(np.float64) if values.size else np.zeros(values.shape[1])
    high = np.nan_to_num(np.nanmax(finite, axis=0)).astype(np.float64) if values.size else np.ones(values.shape[1])
    high = np.maximum(high, low + least_span)
    span = np.where(high > low, high - low, 1.0)
    levels = np.nan_to_num((finite - low) / span * _LEVELS).round()
    return low, high, levels.astype("<u2")


def to_text(values: NDArray[Any]) -> str:
    """Return the bytes of an array in base64."""
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")

# SPDX-License-Identifier: Apache-2.0
"""Texts in CSV files, which spreadsheets must not take for formulas."""

from __future__ import annotations

from typing import Any

_FORMULAS = ("=", "+", "-", "@", "\t", "\r")
"""Beginnings of cells that spreadsheets execute."""


def quoted(value: Any) -> Any:
    """Return a cell: a text that a spreadsheet would take for a formula gets a leading quote; numbers stay."""
    if not isinstance(value, str) or not value.startswith(_FORMULAS):
        return value
    try:
        float(value)
    except ValueError:
        return f"'{value}"
    return value

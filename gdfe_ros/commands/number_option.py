# SPDX-License-Identifier: Apache-2.0
"""Check of numbers given as options of a command, by the ranges of a scene's keys."""

from __future__ import annotations

import math

from pydantic_core import PydanticCustomError

from gdfe_ros.errors import GdfeError
from gdfe_ros.scene.quantity import Quantity


def require_number(option: str, value: float | None, quantity: Quantity) -> None:
    """Raise an error if an option is given and its value is not finite or out of the quantity's range.

    Raises:
        GdfeError: the error names the option, the value and the allowed range.
    """
    if value is None:
        return
    try:
        quantity.check(value)
    except PydanticCustomError as error:
        hint = f"; {value:g} mm are {1e-3 * value:g}" if quantity.unit == "m" and 1.0 <= value < math.inf else ""
        raise GdfeError(f"{option} = {value:g}; {error.message()}{hint}") from error

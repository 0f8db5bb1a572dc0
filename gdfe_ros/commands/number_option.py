# SPDX-License-Identifier: Apache-2.0
"""Check of numbers given as options of a command, by the ranges of a scene's keys."""

from __future__ import annotations

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
        raise GdfeError(f"{option} = {value:g}; {error.message()}") from error

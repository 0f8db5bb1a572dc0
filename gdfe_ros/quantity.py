# SPDX-License-Identifier: Apache-2.0
"""Description of the number in a field: meaning, unit, range, and remedy; written once, beside the field.

The description checks scene files, options of commands, and objects made in Python; the reference of scenes prints it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from scipy.spatial.transform import Rotation

Vector = tuple[float, float, float]
#: Value of `Quantity.count` for a list of any length.
ANY = -1


@dataclass(frozen=True)
class Quantity:
    """Annotation of a field that holds a number or a list of numbers.

    ``Annotated[float, Quantity("Young's modulus", "Pa", above=0)]``

    Attributes:
        meaning: meaning of the number.
        unit: unit of the number; "" for a number without a unit.
        least: smallest allowed value.
        most: largest allowed value.
        above: the value must be larger than this.
        below: the value must be smaller than this.
        count: None for one number, n for a list of n numbers, `ANY` for a list of one or more.
        whole: whether only whole numbers are allowed.
        ascending: whether each component must be at least as large as the component before it.
        infinite: whether infinite values are allowed.
        direction: example of a direction, if the vector is a direction and must not be zero; empty for other numbers.
        remedy: advice for a value out of range.
    """

    meaning: str
    unit: str = ""
    least: float | None = None
    most: float | None = None
    above: float | None = None
    below: float | None = None
    count: int | None = None
    whole: bool = False
    ascending: bool = False
    infinite: bool = False
    direction: str = ""
    remedy: str = ""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Return a schema by which pydantic calls `check` for this field."""
        from pydantic_core import core_schema  # only scene files need it

        return core_schema.no_info_plain_validator_function(self.check)

    @property
    def allowed(self) -> str:
        """Form and range in words, e.g. ``a number: 0 < Young's modulus [Pa] <= 1e+13``."""
        low, high = self.above if self.above is not None else self.least, self.below
        high = high if high is not None else self.most
        name = f"{self.meaning} [{self.unit}]" if self.unit else self.meaning
        text = name
        if low is not None and high is not None:
            text = f"{low:g} {'<' if self.above is not None else '<='} {name}"
            text += f" {'<' if self.below is not None else '<='} {high:g}"
        elif low is not None:
            text = f"{name} {'>' if self.above is not None else '>='} {low:g}"
        elif high is not None:
            text = f"{name} {'<' if self.below is not None else '<='} {high:g}"
        return f"{self._form}: {text}"

    def check(self, value: Any) -> Any:
        """Return the value as a float or int, or as a tuple of floats or ints; numbers in strings are converted.

        Raises:
            ValueError: the value has the wrong type or length, is not finite, or is out of range.
        """
        if self.count is None:
            return self._number(value)
        if not isinstance(value, list | tuple) or not value or self.count not in (ANY, len(value)):
            raise self._error()
        numbers = tuple(self._number(item) for item in value)
        if self.ascending and any(b < a for a, b in pairwise(numbers)):
            raise self._error("in ascending order")
        if self.direction and not any(numbers):
            raise ValueError(f"must not be zero; needed: a direction, e.g. {self.direction}")
        return numbers

    @property
    def _form(self) -> str:
        noun = "whole number" if self.whole else "number"
        if self.count is None:
            return f"a {noun}"
        return f"a list of {noun}s" if self.count == ANY else f"a list of {self.count} {noun}s"

    def _number(self, value: Any) -> float | int:
        if isinstance(value, bool):
            raise self._error()
        try:
            number = float(value)
        except (TypeError, ValueError):
            hint = f"write it without a unit, in {self.unit}" if self.unit and isinstance(value, str) else ""
            raise self._error(hint) from None
        if not (math.isfinite(number) or (self.infinite and not math.isnan(number))):
            raise self._error("finite")
        if self.whole and number != int(number):
            raise self._error()
        if not self._allows(number):
            raise self._error(self.remedy)
        return int(number) if self.whole else number

    def _allows(self, number: float) -> bool:
        """Return whether a number is within the bounds."""
        return (
            (self.least is None or number >= self.least)
            and (self.most is None or number <= self.most)
            and (self.above is None or number > self.above)
            and (self.below is None or number < self.below)
        )

    def _error(self, remedy: str = "") -> ValueError:
        return ValueError(f"allowed is {self.allowed}" + (f"; {remedy}" if remedy else ""))


@dataclass(frozen=True)
class RotationQuantity(Quantity):
    """Annotation of a field that holds a rotation vector [degrees]; several are applied one after another."""

    unit: str = "degrees"
    least: float = -36000.0
    most: float = 36000.0
    count: int = 3

    def check(self, value: Any) -> tuple[float, float, float]:
        """Return the rotation vector (3,) [degrees]; a list of vectors becomes the vector of their composition.

        The axes stay fixed: ``[[0, 90, 0], [0, 0, 120]]`` first turns about y, and then about z.

        Raises:
            ValueError: a vector has the wrong length, or a component is no number or out of range.
        """
        if not (isinstance(value, list | tuple) and value and all(isinstance(item, list | tuple) for item in value)):
            return super().check(value)
        total = Rotation.identity()
        for vector in value:
            total = Rotation.from_rotvec(super().check(vector), degrees=True) * total
        return tuple(total.as_rotvec(degrees=True).tolist())

    @property
    def _form(self) -> str:
        return f"{super()._form} or a list of such lists"


def find_quantity(annotation: Any) -> Quantity | None:
    """Return the `Quantity` of an annotation; None if its values are not numbers or lists of numbers."""
    if get_origin(annotation) is Annotated:
        return next((item for item in get_args(annotation)[1:] if isinstance(item, Quantity)), None)
    if get_origin(annotation) in (Union, UnionType):
        return next(filter(None, map(find_quantity, get_args(annotation))), None)
    return None


@cache
def quantities_of(kind: type) -> Mapping[str, Quantity]:
    """Return a dict from the name of each field of a class that holds numbers to its `Quantity`."""
    found = {name: find_quantity(hint) for name, hint in get_type_hints(kind, include_extras=True).items()}
    return {name: quantity for name, quantity in found.items() if quantity is not None}

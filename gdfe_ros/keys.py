# SPDX-License-Identifier: Apache-2.0
"""Base classes of the objects that a scene file defines: each field of such a class is a key of the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from gdfe_ros.quantity import quantities_of


@dataclass(frozen=True)
class Meaning:
    """Annotation of a field whose value is not a number: the meaning of the value, for users."""

    text: str


class FieldError(ValueError):
    """A value of a field that is not allowed.

    Args:
        field: name of the field.
        value: its value.
        text: allowed values, and the remedy.
    """

    def __init__(self, field: str, value: object, text: str) -> None:
        super().__init__(f"{field} = {value!r}: {text}")
        self.field, self.text = field, text


class Keys:
    """Base class of dataclasses that a scene file defines: each field is a key, and other keys are refused."""

    __pydantic_config__: ClassVar[Mapping[str, str]] = {"extra": "forbid"}


class CheckedKeys(Keys):
    """Base class of `Keys` whose numbers are checked even if Python code, and no scene file, makes the object.

    Raises:
        FieldError: the `Quantity` of a field does not allow its number; None, for a missing number, is allowed.
    """

    def __post_init__(self) -> None:
        for name, quantity in quantities_of(type(self)).items():
            value = getattr(self, name)
            try:
                if value is not None:
                    quantity.check(value)
            except ValueError as error:
                raise FieldError(name, value, str(error)) from error


class Alternatives:
    """Base class of entries that need exactly one of several keys, e.g. ``{face: x-}``.

    Attributes:
        options: keys that may be given in addition to the chosen key.
        alone: keys among the ``options`` that may be given without a chosen key.
    """

    options: ClassVar[tuple[str, ...]] = ()
    alone: ClassVar[tuple[str, ...]] = ()

    def require_one(self) -> None:
        """Raise ValueError if there is not exactly one of the keys."""
        names = [name for name in vars(self) if name not in self.options]
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) > 1 or not (given or any(getattr(self, name) is not None for name in self.alone)):
            raise ValueError(f"give exactly one of {', '.join(names)}; given: {', '.join(given) or 'none'}")

    @property
    def chosen(self) -> tuple[str, Any]:
        """Name of the chosen key, and its value."""
        return next(
            (name, value) for name, value in vars(self).items() if value is not None and name not in self.options
        )

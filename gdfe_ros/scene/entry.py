# SPDX-License-Identifier: Apache-2.0
"""What all entries of a scene file have in common."""

from __future__ import annotations

from typing import Any, ClassVar

from pydantic import BaseModel, ConfigDict, model_validator


class Entry(BaseModel):
    """A mapping of the scene file: no other keys than the declared ones, immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Choice(Entry):
    """An entry of which exactly one key is given, e.g. ``{face: x-}``; every field is optional.

    Attributes:
        options: keys that may stand beside the chosen one.
    """

    options: ClassVar[tuple[str, ...]] = ()

    @model_validator(mode="after")
    def _exactly_one(self) -> Choice:
        names = [name for name in type(self).model_fields if name not in self.options]
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"give exactly one of {', '.join(names)}; given: {', '.join(given) or 'none'}")
        return self

    @property
    def chosen(self) -> tuple[str, Any]:
        """The key that is given and its value."""
        return next((name, value) for name, value in self if value is not None and name not in self.options)

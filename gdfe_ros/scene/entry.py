# SPDX-License-Identifier: Apache-2.0
"""Base classes of the entries of a scene file."""

from __future__ import annotations

from typing import Any, ClassVar

from pydantic import BaseModel, ConfigDict, model_validator

#: Start of the tags that pydantic puts into the location of an error; they are not keys of the file.
TAG = "kind="


class Entry(BaseModel):
    """A mapping of the scene file: immutable, with the declared keys only."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Choice(Entry):
    """An entry with exactly one of several keys, e.g. ``{face: x-}``; every field is optional.

    Attributes:
        options: keys that may stand beside the chosen one.
        alone: keys among the ``options`` that suffice without a chosen one.
    """

    options: ClassVar[tuple[str, ...]] = ()
    alone: ClassVar[tuple[str, ...]] = ()

    @model_validator(mode="after")
    def _exactly_one(self) -> Choice:
        names = [name for name in type(self).model_fields if name not in self.options]
        given = [name for name in names if getattr(self, name) is not None]
        enough = any(getattr(self, name) is not None for name in self.alone)
        if len(given) > 1 or not (given or enough):
            raise ValueError(f"give exactly one of {', '.join(names)}; given: {', '.join(given) or 'none'}")
        return self

    @property
    def chosen(self) -> tuple[str, Any]:
        """The key that is given and its value."""
        return next((name, value) for name, value in self if value is not None and name not in self.options)

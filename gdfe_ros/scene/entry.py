# SPDX-License-Identifier: Apache-2.0
"""Base classes of the entries of a scene file."""

from __future__ import annotations

from typing import Any, ClassVar

from pydantic import BaseModel, ConfigDict, model_validator

#: First letters of the tags that pydantic adds to the location of an error; the tags are not keys of the file, because
#: YAML allows no NUL in a key.
TAG = "\0kind="


class Entry(BaseModel):
    """A mapping of the scene file: immutable, and without keys other than the declared ones."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Choice(Entry):
    """An entry that needs exactly one of several keys, e.g. ``{face: x-}``; each field by itself is optional.

    Attributes:
        options: keys that may be given in addition to the chosen key.
        alone: keys among the ``options`` that may be given without a chosen key.
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
        """Name of the chosen key, and its value."""
        return next((name, value) for name, value in self if value is not None and name not in self.options)

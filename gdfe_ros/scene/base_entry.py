# SPDX-License-Identifier: Apache-2.0
"""Base classes of the entries of a scene file."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator

from gdfe_ros.keys import Alternatives

#: Prefix of the tags that pydantic adds to the location of an error. No key of a file begins with it, because YAML
#: allows no NUL in a key.
TAG = "\0kind="
#: Prefix of pydantic's message about a ValueError.
VALUE_ERROR = "Value error, "


class Entry(BaseModel):
    """Base class of the mappings in a scene file: immutable, and undeclared keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def one_of(first: str, second: str, text: str) -> Any:
    """Return a validator of an entry that needs exactly one of two keys; ``text`` is its error message."""

    @model_validator(mode="after")
    def check(self: Entry) -> Entry:
        if bool(getattr(self, first)) == bool(getattr(self, second)):
            raise ValueError(text)
        return self

    return check


def belongs(option: str, owner: str, text: str) -> Any:
    """Return a validator of an entry whose key ``option`` needs the key ``owner``; ``text`` is its error message."""

    @model_validator(mode="after")
    def check(self: Entry) -> Entry:
        if getattr(self, option) is not None and getattr(self, owner) is None:
            raise ValueError(text)
        return self

    return check


class Choice(Alternatives, Entry):
    """An entry that needs exactly one of several keys."""

    @model_validator(mode="after")
    def _exactly_one(self) -> Choice:
        self.require_one()
        return self

# SPDX-License-Identifier: Apache-2.0
"""Suggestion of a known word for a misspelt word."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

LIKENESS = 0.5
"""Least fraction of matching letters, from 0 to 1, at which a known word is suggested."""


def closest(given: str, known: Iterable[str]) -> str | None:
    """Return the known word most similar to the given one; None if none is similar."""
    found = get_close_matches(given, list(known), n=1, cutoff=LIKENESS)
    return found[0] if found else None


def did_you_mean(given: str, known: Iterable[str]) -> str:
    """Return ``did you mean 'x'? ``, or an empty text if no known word is similar."""
    word = closest(given, known)
    return f"did you mean {word!r}? " if word is not None else ""

# SPDX-License-Identifier: Apache-2.0
"""Known words are suggested for misspelt ones."""

from __future__ import annotations

import pytest

from gdfe_ros.untrusted.spelling import closest, did_you_mean


@pytest.mark.parametrize(
    ("given", "expected"), [("tipp", "did you mean 'tip'? "), ("base", "did you mean 'base'? "), ("xyz", "")]
)
def test_the_word_most_like_the_given_one_is_suggested(given: str, expected: str) -> None:
    """A misspelt word gives the closest known word, and an unrelated one gives none."""
    assert did_you_mean(given, ("tip", "base")) == expected


def test_nothing_is_close_where_nothing_is_known() -> None:
    """Without known words nothing is close."""
    assert closest("tip", ()) is None

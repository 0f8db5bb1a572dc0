# SPDX-License-Identifier: Apache-2.0
"""Random examples of the fuzzing tests: how many, and the entries of a text that they change."""

from __future__ import annotations

import copy
import os
from typing import Any

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

EXAMPLES = int(os.environ.get("TORTURE_EXAMPLES", "0"))
"""Random examples of each fuzzing test; 0 for a few fixed ones."""


def examples(few: int) -> settings:
    """Return the settings of a test that tries ``few`` fixed examples, or `EXAMPLES` random ones."""
    return settings(
        max_examples=EXAMPLES or few,
        deadline=None,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
        derandomize=not EXAMPLES,
    )


ODD = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**20), 10**20),
    st.floats(),
    st.sampled_from([0, -1, 1e-300, 1e-170, 1e-15, 1e-5, 1e300, "x", "", "1e3", "nan", "energy", "x-", "a\0b"]),
    st.sampled_from(["soft", "body_hard", "a" * 5000, [], {}, [1, 2], {"a": 1}]),
    st.text(max_size=8),
    st.lists(st.floats(), max_size=4),
)
"""Values that an entry of a scene cannot have, or hardly."""


def with_value(data: Any, path: tuple[Any, ...], value: Any) -> Any:
    """Return a copy of nested dicts and lists in which the entry at ``path`` is ``value``."""
    data = target = copy.deepcopy(data)
    for key in path[:-1]:
        target = target[key]
    target[path[-1]] = value
    return data


def entries_of(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the key path of every entry of nested dicts and lists."""
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [place for key, value in items for place in ((*path, key), *entries_of(value, (*path, key)))]

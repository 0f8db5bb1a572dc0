# SPDX-License-Identifier: Apache-2.0
"""Random examples of the fuzzing tests: how many, and the entries of a text that they change."""

from __future__ import annotations

import os
from typing import Any

from hypothesis import HealthCheck, settings

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


def entries_of(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the key path of every entry of nested dicts and lists."""
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [place for key, value in items for place in ((*path, key), *entries_of(value, (*path, key)))]

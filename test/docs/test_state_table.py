# SPDX-License-Identifier: Apache-2.0
"""The table of what a controller gets in a test, in docs/controllers.md."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

from gdfe_ros.testing.published_state import PublishedState

PAGE = Path(__file__).parents[2] / "docs" / "controllers.md"


def test_the_table_has_every_attribute_of_a_state() -> None:
    """Each attribute of a published state is in the table, and the table has no others."""
    table = PAGE.read_text(encoding="utf-8").partition("A `state` has")[2].partition("\nEach `Simulator`")[0]
    first = " ".join(line.split("|")[1] for line in table.splitlines() if line.startswith("| `"))
    assert set(re.findall(r"`([a-z]\w*)", first)) == {each.name for each in fields(PublishedState)} | {"time"}

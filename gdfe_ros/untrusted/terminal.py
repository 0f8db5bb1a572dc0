# SPDX-License-Identifier: Apache-2.0
"""A console that escapes control characters in texts of unknown senders, and the tables that commands print."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from gdfe_ros.untrusted.bounded_text import plain_lines

QUANTITIES = ("quantity", "value", "unit")
"""Headings of a table of results."""


class PlainConsole(Console):
    """A console of rich that shows every text as it is: markup is no markup, and control characters are escaped.

    Args:
        options: options of rich's console.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """Return a text in rich's type, with its control characters escaped."""
        return super().render_str(plain_lines(text), **options)


def make_table(
    title: str,
    heads: Sequence[str] = (),
    rows: Iterable[Sequence[str]] = (),
    *,
    right: Collection[str] = (),
    fold: bool = False,
    **options: Any,
) -> Table:
    """Return a table; without ``heads`` it has no line of headings, and a column for each cell of a row.

    Args:
        title: title, on the left above the table.
        heads: headings of the columns.
        rows: texts of the cells.
        right: headings of the columns that are aligned to the right.
        fold: whether a long cell is folded, instead of cut.
        options: options of rich's table.
    """
    table = Table(title=title, title_justify="left", show_header=bool(heads), **options)
    for head in heads:
        table.add_column(head, justify="right" if head in right else "left", overflow="fold" if fold else "ellipsis")
    for row in rows:
        table.add_row(*row)
    return table

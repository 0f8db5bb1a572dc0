# SPDX-License-Identifier: Apache-2.0
"""Tables of the benchmarks as Markdown, and the marks in a document between which they are printed."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

MARK = "<!-- {name}: printed by make docs -->"
"""Line before a printed text; ``<!-- end NAME -->`` follows it."""


def markdown_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table; every row has as many cells as there are ``heads``."""
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def left_out(missing: Mapping[str, str]) -> str:
    """Return the sentences for below a table about missing solvers; ``missing`` is a dict from solver to reason."""
    return "".join(f"\n\nNot measured: {name}: {reason}." for name, reason in missing.items())


def replace_tables(document: str, tables: Mapping[str, str]) -> str:
    """Return a document in which the text between each pair of marks is replaced by the text with the mark's name.

    Raises:
        ValueError: a mark has no end, or there is no text with its name.
    """
    pieces, rest = [], document
    while found := re.search(MARK.format(name="([^:>]+)"), rest):
        name = found[1]
        _, end, after = rest[found.end() :].partition(f"<!-- end {name} -->")
        if name not in tables or not end:
            raise ValueError(f"nothing is printed between the marks of {name!r}; there is: {', '.join(tables)}")
        pieces.append(f"{rest[: found.end()]}\n{tables[name]}\n{end}")
        rest = after
    return "".join([*pieces, rest])

# SPDX-License-Identifier: Apache-2.0
"""Words of docs/contributing.md ("One word, one meaning") have no second meaning in docstrings and pages."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = (ROOT / "README.md", ROOT / "CHANGELOG.md", *(ROOT / "docs").rglob("*.md"))
TABLE = "## One word, one meaning"
THING = r"body|mesh|vertices|handle|links|joints|modul(?:us|i)|stiffness|tangent|shape|volume|area|centre|frame|energy"
SECOND = {
    "at rest": rf"\b(?:{THING}) at rest(?! on\b)|\bthat at rest\b|\bin motion and at rest\b",
    "share": r"\b(?:a|an|the|each|its|their|this|such|least|largest|filled|local) shares?\b|\bshares? of\b",
    "told": r"\btold\b(?!:)",
    "way": r"\bways?\b(?!:)",
    "stream": r"\bstreams? of (?:bytes|commands|messages)\b|\bbyte streams?\b",
}
"""Dict from word to the expression of its second meanings; names of arguments in docstrings end with a colon."""
RIGHT = r"\b(?:a body|body is|vertices|is) at rest\b|\bshare director|\*on their way\*"
"""Expressions that match `SECOND` but have the right meaning."""


def prose(page: Path) -> str:
    """Return a page without code, printed tables and the table of words itself."""
    text = re.sub(r"<!-- ([\w ]+): printed.*?<!-- end \1 -->", "", page.read_text(encoding="utf-8"), flags=re.S)
    text = re.sub(r"^```.*?^```|`[^`\n]*`", "", text, flags=re.S | re.M)
    head, found, rest = text.partition(TABLE)
    return head + rest.partition("\n## ")[2] if found else text


def docstrings(path: Path) -> str:
    """Return the docstrings of a module, those of its constants included, without quoted names."""
    constants = [
        node.value for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Expr)
    ]
    text = "\n".join(str(item.value) for item in constants if isinstance(item, ast.Constant))
    return re.sub(r"`+[^`\n]*`+", "", text)


@cache
def texts() -> dict[Path, str]:
    """Return a dict from path to text, in one line, for every page and every module's docstrings; cached."""
    found = {page: prose(page) for page in PAGES}
    found |= {path: docstrings(path) for path in (ROOT / "gdfe_ros").rglob("*.py")}
    return {path: " ".join(text.split()) for path, text in found.items()}


@pytest.mark.parametrize("word", SECOND)
def test_a_word_has_one_meaning(word: str) -> None:
    """No page and no docstring of the package uses the word in a second meaning."""
    found = []
    for path, text in texts().items():
        plain = re.sub(RIGHT, "", text, flags=re.I)
        found += [f"{path.relative_to(ROOT)}: ...{plain[max(0, m.start() - 30) : m.end() + 20]}..."
                  for m in re.finditer(SECOND[word], plain, flags=re.I)]  # fmt: skip
    assert found == []


@pytest.mark.parametrize("word", SECOND)
def test_the_words_are_in_the_table(word: str) -> None:
    """The table has a row for the word with its one meaning and the words for other meanings."""
    table = (ROOT / "docs" / "contributing.md").read_text(encoding="utf-8").partition(TABLE)[2].partition("\n## ")[0]
    assert re.search(rf"^\| {word} \| [^|]+ \| [^|]+ \|$", table, flags=re.M)

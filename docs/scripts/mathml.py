# SPDX-License-Identifier: Apache-2.0
"""Hook of mkdocs: formulas between dollar signs become MathML, which browsers draw themselves, also offline."""

from __future__ import annotations

import re
from typing import Any

from latex2mathml.converter import convert

_CODE = re.compile(r"(```.*?```|`[^`\n]*`)", re.DOTALL)
_FORMULA = re.compile(r"\$\$(?P<block>.+?)\$\$|\$(?P<inline>(?:[^$\n]|\n(?!\n))+)\$", re.DOTALL)
_PRIME = re.compile(r"<msup>(<m[io]>[^<]*</m[io]>)<mi>&#x02032;</mi></msup>")
"""A prime is raised by itself; as a superscript it would fly off."""
_formulas: list[str] = []


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put a word that Markdown leaves alone in the place of each formula outside of code."""
    _formulas.clear()
    parts = _CODE.split(markdown)
    parts[::2] = [_FORMULA.sub(_hold, part) for part in parts[::2]]
    return "".join(parts)


def on_page_content(html: str, **_: Any) -> str:
    """Put the formulas back, as MathML."""
    return re.sub(r"FORMULA(\d+)END", lambda found: _formulas[int(found[1])], html)


def _hold(found: re.Match[str]) -> str:
    block = found["block"] is not None
    text = " ".join((found["block"] if block else found["inline"]).split())
    formula = convert(text, display="block" if block else "inline")
    _formulas.append(_PRIME.sub(r"\1<mo>&#x02032;</mo>", formula))
    return f"FORMULA{len(_formulas) - 1}END"

# SPDX-License-Identifier: Apache-2.0
"""Hook of mkdocs that converts formulas between dollar signs to MathML, which browsers can draw offline."""

from __future__ import annotations

import re
from typing import Any

from latex2mathml.converter import convert

_CODE = re.compile(r"(```.*?```|`[^`\n]*`)", re.DOTALL)
_FORMULA = re.compile(r"\$\$(?P<block>.+?)\$\$|\$(?P<inline>(?:[^$\n]|\n(?!\n))+)\$", re.DOTALL)
_PRIME = re.compile(r"<msup>(<m[io]>[^<]*</m[io]>)<mi>&#x02032;</mi></msup>")
"""A prime is already raised; as a superscript it would be drawn too high."""
_formulas: list[str] = []


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Replace each formula outside code by a word that Markdown does not change."""
    _formulas.clear()
    parts = _CODE.split(markdown)
    parts[::2] = [_FORMULA.sub(_hold, part) for part in parts[::2]]
    return "".join(parts)


def on_page_content(html: str, **_: Any) -> str:
    """Replace these words by the formulas as MathML."""
    return re.sub(r"FORMULA(\d+)END", lambda found: _formulas[int(found[1])], html)


def _hold(found: re.Match[str]) -> str:
    block = found["block"] is not None
    text = " ".join((found["block"] if block else found["inline"]).split())
    formula = convert(text, display="block" if block else "inline")
    _formulas.append(_PRIME.sub(r"\1<mo>&#x02032;</mo>", formula))
    return f"FORMULA{len(_formulas) - 1}END"

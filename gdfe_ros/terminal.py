# SPDX-License-Identifier: Apache-2.0
"""A console for texts of unknown senders, such as names of groups in meshes: a terminal obeys control characters."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.text import Text

from gdfe_ros.bounded_text import plain_lines


class PlainConsole(Console):
    """A console of rich that shows every text as it is: markup is no markup, and control characters are escaped.

    Args:
        options: options of rich's console.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """Return a text as rich shows it, which has no control characters."""
        return super().render_str(plain_lines(text), **options)

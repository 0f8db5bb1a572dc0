# SPDX-License-Identifier: Apache-2.0
"""Table and picture from a torture.json: ``python -m benchmarks.torture torture.json [torture.png]``."""

from __future__ import annotations

import sys
from pathlib import Path

from rich.console import Console

from benchmarks.torture.picture import draw_scores
from benchmarks.torture.score import read_scores, rich_table


def main() -> None:
    """Print the table of the file named on the command line; if a picture is also named, draw it."""
    scores = read_scores(Path(sys.argv[1] if len(sys.argv) > 1 else "runs/torture/torture.json"))
    Console(width=140).print(rich_table(scores))
    if len(sys.argv) > 2:
        draw_scores(Path(sys.argv[2]), scores)


if __name__ == "__main__":
    main()

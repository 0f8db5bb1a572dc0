# SPDX-License-Identifier: Apache-2.0
"""``gdfe compare``: report whether two recorded runs differ, where, and by how much."""

from __future__ import annotations

import argparse
from pathlib import Path

from gdfe_ros.analysis.difference import Comparison, Difference, compare_bags
from gdfe_ros.analysis.difference_table import difference_table, wide_console

DIFFERENT = 1
_MOST = 20


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "first", type=Path, metavar="A", help="directory of a bag that sim_node recorded, or of its run"
    )
    parser.add_argument("second", type=Path, metavar="B", help="directory of another bag, or of its run")
    parser.add_argument(
        "--within",
        type=float,
        default=0.0,
        metavar="FACTOR",
        help="also pass if no difference exceeds FACTOR times the solver tolerance of A (default: all arrays must be "
        "bit-identical)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Compare two runs and print the differences; return 0 if they agree, else 1."""
    comparison = compare_bags(arguments.first, arguments.second)
    differences, console = comparison.differences, wide_console()
    verdict = comparison.verdict(arguments.within)
    for text in _remarks(comparison):
        console.print(text)
    if differences.differing:
        console.print(difference_table(differences, factor=arguments.within))
    passed = verdict in (Difference.IDENTICAL, Difference.WITHIN)
    text = f"{verdict.value}: {differences.steps} steps, {differences.compared} arrays compared"
    console.print(text, style="green" if passed else "red")
    return 0 if passed else DIFFERENT


def _remarks(comparison: Comparison) -> list[str]:
    remarks = []
    if comparison.scene_changes:
        changes = comparison.scene_changes
        remarks = ["the scenes differ:", *(f"  {key}: {a} -> {b}" for key, (a, b) in [*changes.items()][:_MOST])]
        if len(changes) > _MOST:
            remarks.append(f"  and {len(changes) - _MOST} more keys")
    for name, count in zip("AB", comparison.only, strict=True):
        if count:
            remarks.append(f"{count} steps of {name} have no step with the same stamp in the other bag")
    for name, topics in zip("AB", comparison.foreign, strict=True):
        if topics:
            text = f"{', '.join(topics)} of {name}"
            remarks.append(f"not compared, because the bag does not say which topics of the node they are: {text}")
    if comparison.differences.unmatched:
        remarks.append(f"arrays in only one of the bags: {dict(comparison.differences.unmatched)}")
    return remarks

# SPDX-License-Identifier: Apache-2.0
"""Latencies, floods of bad commands and SIGKILLs for this tree and for another commit, measured in turn.

``python -m benchmarks.node.since COMMIT`` (or a directory with its tree) prints the table. Both nodes are measured by
the client of this tree.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.markdown import markdown_table
from benchmarks.node import flood, kills, latency

ROOT = Path(__file__).resolve().parents[2]
Figures = dict[str, float]
"""Dict from name of a measurement to its value."""


def main() -> int:
    """Measure both trees in turn, print the medians of both, write since.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.node.since", description=__doc__)
    parser.add_argument("commit", help="commit, or directory with its tree")
    parser.add_argument("--out", type=Path, default=Path("runs/bench/since.json"), help="file of the report")
    parser.add_argument("--rounds", type=int, default=3, help="of each measurement, in turn")
    parser.add_argument("--steps", type=int, default=300, help="steps of each latency")
    parser.add_argument("--commands", type=int, default=20_000, help="bad ones, in each of two scenes")
    parser.add_argument("--kills", type=int, default=5, help="SIGKILLs in each round")
    given = parser.parse_args()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with _tree(given.commit) as before:
        rounds: dict[str, list[Figures]] = {"before": [], "now": []}
        for number in range(given.rounds):
            for name, home in (("before", before), ("now", ROOT)):
                rounds[name].append(_measure(home, given, seed=number))
                print(f"round {number + 1} of {given.rounds}, {name}: {rounds[name][-1]}", file=sys.stderr, flush=True)
    print(table(rounds))
    given.out.parent.mkdir(parents=True, exist_ok=True)
    given.out.write_text(json.dumps({"commit": given.commit, **rounds}, indent=1) + "\n", encoding="utf-8")
    return 0


def table(rounds: Mapping[str, Sequence[Figures]]) -> str:
    """Return the table with the medians of each figure, for the commit and for this tree."""
    names = rounds["now"][0]
    medians = {
        side: {name: statistics.median(each[name] for each in rounds[side]) for name in names} for side in rounds
    }
    rows = [(name, *(f"{medians[side][name]:.4g}" for side in rounds)) for name in names]
    return markdown_table(("measured", *rounds), rows)


def _measure(home: Path, given: argparse.Namespace, *, seed: int) -> Figures:
    """Make all measurements once; return times in ms and memory in MB."""
    figures: Figures = {}
    for elements in (500, 1250):
        found = latency.measure(elements, steps=given.steps, home=home)
        figures |= {
            f"{elements} elements, command to mesh p50 [ms]": found.p50,
            f"{elements} elements, command to mesh p99 [ms]": found.p99,
            f"{elements} elements, of that the solve p50 [ms]": found.solve_p50,
        }
    for scene in flood.SCENES:
        found = flood.measure(scene, count=given.commands, home=home)
        figures |= {
            f"bad commands, {scene}: not refused": found.sent - found.refused,
            f"bad commands, {scene}: meshes not finite, or exit status": float(not found.finite) + found.status,
            f"bad commands, {scene}: memory grew by [MB]": found.memory / 1e6,
        }
    found = kills.measure(given.kills, seed=seed, home=home)
    return figures | {
        "SIGKILLs": found.killed,
        "bags recovered": found.recovered,
        "of these replayed to the bit": found.identical,
    }


@contextmanager
def _tree(commit: str) -> Iterator[Path]:
    """Return a directory with the tree of a commit."""
    if Path(commit).is_dir():
        yield Path(commit).resolve()
        return
    with TemporaryDirectory(prefix="gdfe_since_") as folder:
        archive = subprocess.run(["git", "archive", commit], cwd=ROOT, capture_output=True, check=True).stdout
        subprocess.run(["tar", "xf", "-", "-C", folder], input=archive, check=True)
        yield Path(folder)


if __name__ == "__main__":
    sys.exit(main())

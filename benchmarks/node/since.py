# SPDX-License-Identifier: Apache-2.0
"""Latencies, floods of bad commands and SIGKILLs of this tree beside those of another commit.

``python -m benchmarks.node.since COMMIT`` (or a directory with its tree) prints the table. Both nodes are measured by
the client of this tree. For the latencies both run at the same time, and take the same commands in turn: the median of
the ratios of pairs hardly depends on other work on the machine.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from benchmarks.markdown import markdown_table
from benchmarks.node import flood, kills, latency
from benchmarks.since import archived

ROOT = Path(__file__).resolve().parents[2]
CELLS = (500, 1250)
"""Numbers of elements of the bars."""
Figures = dict[str, float]
"""Dict from name of a measurement to its value."""


def main() -> int:
    """Measure both trees, print the latencies and then the table of all figures, write since.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.node.since", description=__doc__)
    parser.add_argument("commit", help="commit, or directory with its tree")
    parser.add_argument("--out", type=Path, default=Path("runs/bench/node_since.json"), help="file of the report")
    parser.add_argument(
        "--rounds", type=int, default=3, help="pairs of nodes of each latency, and floods of each scene"
    )
    parser.add_argument("--steps", type=int, default=300, help="steps of each latency")
    parser.add_argument("--commands", type=int, default=20_000, help="bad ones, in each of two scenes; 0: none")
    parser.add_argument("--kills", type=int, default=5, help="SIGKILLs of each tree; 0: none")
    given = parser.parse_args()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    homes = {"before": archived(given.commit), "now": ROOT}
    rounds: dict[str, list[Figures]] = {"before": [], "now": [], "ratio": []}
    for number in range(given.rounds):
        for side, figures in measure_latencies(homes, steps=given.steps).items():
            rounds[side].append(figures)
            print(f"round {number + 1} of {given.rounds}, {side}: {figures}", file=sys.stderr, flush=True)
    print(table(rounds), flush=True)
    attacked: dict[str, list[Figures]] = {"before": [], "now": []}
    for number in range(given.rounds if given.commands else 0):
        for side, home in homes.items():
            attacked[side].append(_flood(home, given.commands))
            print(f"floods {number + 1} of {given.rounds}, {side}: {attacked[side][-1]}", file=sys.stderr, flush=True)
    killed = {side: [_kill(home, given.kills)] for side, home in homes.items()} if given.kills else {}
    for found in filter(None, (attacked if given.commands else {}, killed)):
        print(table(found), flush=True)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    report = {"commit": given.commit, "latencies": rounds, "floods": attacked, "kills": killed}
    given.out.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    return 0


def table(rounds: Mapping[str, Sequence[Figures]]) -> str:
    """Return the table with the medians of each figure, for the commit and for this tree, and of ratios."""
    names = rounds["now"][0]
    rows = [
        (name, *(f"{statistics.median(each[name] for each in figures):.4g}" for figures in rounds.values()))
        for name in names
    ]
    return markdown_table(("measured", *rounds), rows)


def measure_latencies(homes: Mapping[str, Path], *, steps: int) -> dict[str, Figures]:
    """Return the latencies of both trees [ms], and their ratios, now over before."""
    found: dict[str, Figures] = {"before": {}, "now": {}, "ratio": {}}
    for elements in CELLS:
        pairs = latency.compare(elements, steps=steps, **homes)
        for side, times in (("before", pairs.before), ("now", pairs.now)):
            found[side] |= {
                f"{elements} elements, command to mesh p50 [ms]": times.p50,
                f"{elements} elements, command to mesh p99 [ms]": times.p99,
                f"{elements} elements, without the solve p50 [ms]": times.own_p50,
                f"{elements} elements, without the solve p99 [ms]": times.own_p99,
                f"{elements} elements, processor time per step [ms]": times.processor,
            }
        found["ratio"] |= dict(zip(list(found["now"])[-5:], pairs.ratios, strict=True))
    return found


def _flood(home: Path, commands: int) -> Figures:
    figures: Figures = {}
    for scene in flood.SCENES:
        found = flood.measure(scene, count=commands, home=home)
        figures |= {
            f"bad commands, {scene}: not refused": found.sent - found.refused,
            f"bad commands, {scene}: meshes not finite, or exit status": float(not found.finite) + found.status,
            f"bad commands, {scene}: memory grew by [MB]": found.memory / 1e6,
        }
    return figures


def _kill(home: Path, count: int) -> Figures:
    found = kills.measure(count, home=home)
    return {
        "SIGKILLs": found.killed,
        "bags recovered": found.recovered,
        "of these replayed to the bit": found.identical,
    }


if __name__ == "__main__":
    sys.exit(main())

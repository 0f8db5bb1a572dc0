# SPDX-License-Identifier: Apache-2.0
"""``make bench-since COMMIT=...``: run times of this tree beside those of another commit, both played in turn.

Each tree plays with its own package in a separate process with one thread. Both processes run on the same core in turn,
so that other work on the machine slows down both. The median of the ratios of pairs is more reliable than a pair of
times. The commit is checked out and installed once.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.markdown import markdown_table
from benchmarks.report import options, write_report
from gdfe_ros.workers import THREAD_COUNTS

ROOT = Path(__file__).resolve().parent.parent
PLAYER = Path(__file__).with_name("player.py")
TURNS = 7
"""Number of pairs of runs of each play, after one pair that is not timed."""


@dataclass(frozen=True)
class Play:
    """A scene's program with a number of steps.

    Attributes:
        scene: name of a shipped scene.
        steps: number of equal steps of the program; None for the number in its settings, for most scenes a cold solve.
        overrides: dict from scene key to value.
    """

    scene: str
    steps: int | None
    overrides: Mapping[str, Any] = field(default_factory=dict)


PLAYS: dict[str, Play] = {
    "bend5, streamed": Play("bend5", 200),
    "twist90, streamed": Play("twist90", 90),
    "tensile, streamed": Play("tensile", 100),
    "bend5 10x1x1, streamed": Play("bend5", 400, {"mesh.bar.cells": [10, 1, 1]}),
    "bend5, cold": Play("bend5", None),
    "twist90, cold": Play("twist90", None),
    "tensile, cold": Play("tensile", None),
    "tendon_finger": Play("tendon_finger", 150),
    "pneunet": Play("pneunet", 60),
    "bending_tube": Play("bending_tube", 60),
    "three_chamber_arm": Play("three_chamber_arm", 60),
    "gripper": Play("gripper", 60),
    "shape_memory_strip": Play("shape_memory_strip", 60),
    "two_material_bar": Play("two_material_bar", 100),
    "tendon_finger, 10 ms": Play("tendon_finger", 400),
    "gripper, 10 ms": Play("gripper", 400),
    "three_chamber_arm, 10 ms": Play("three_chamber_arm", 600),
    "bending_tube, 10 ms": Play("bending_tube", 400),
    "pneunet, 10 ms": Play("pneunet", 400),
    "shape_memory_strip, 10 ms": Play("shape_memory_strip", 400),
}
"""Dict from name to play: streams of small steps, cold solves, robots' programs in coarse steps and in 10 ms steps."""


@dataclass(frozen=True)
class Comparison:
    """Comparison of one play in both trees.

    Attributes:
        name: name of the play.
        steps: number of steps of a run.
        before, after: median processor time of a run [s], in the commit's tree and in this tree.
        ratio: median of after / before of all pairs.
        iterations: numbers of iterations of a run, before and after.
        same: whether the final positions are bit-identical.
    """

    name: str
    steps: int
    before: float
    after: float
    ratio: float
    iterations: tuple[int, int]
    same: bool


class Player:
    """A process that plays scenes with the package of one tree.

    Args:
        tree: checkout with its own ``.venv``.
        core: processor core of the process.
    """

    def __init__(self, tree: Path, core: int) -> None:
        threads = dict.fromkeys(THREAD_COUNTS, "1")
        # The script's own directory would come first on the path, and with it this tree's modules.
        command = [
            tree / ".venv/bin/python",
            "-c",
            f"import runpy; runpy.run_path({str(PLAYER)!r}, run_name='__main__')",
        ]
        self._process = subprocess.Popen(
            command, cwd=tree, env=os.environ | threads, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        os.sched_setaffinity(self._process.pid, {core})

    def play(self, play: Play) -> dict[str, Any]:
        """Play once, and return the answer of the process.

        Raises:
            RuntimeError: the process ended without an answer.
        """
        self._process.stdin.write(json.dumps([play.scene, play.steps, dict(play.overrides)]) + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        if not answer:
            raise RuntimeError(f"the player of {self._process.args[0]} ended: {self._process.wait()}")
        return json.loads(answer)

    def close(self) -> None:
        """End the process."""
        self._process.stdin.close()
        self._process.wait()


def archived(commit: str) -> Path:
    """Return the tree of a commit, or the directory of that name; it is written if it does not exist."""
    if Path(commit).is_dir():
        return Path(commit).resolve()
    command = ["git", "rev-parse", "--short", f"{commit}^{{commit}}"]
    short = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()
    tree = ROOT / "build" / "since" / short
    if not tree.exists():
        archive = subprocess.run(["git", "archive", short], cwd=ROOT, check=True, capture_output=True).stdout
        tree.mkdir(parents=True)
        subprocess.run(["tar", "xf", "-"], cwd=tree, input=archive, check=True)
    return tree


def checkout(commit: str) -> Path:
    """Return the tree of a commit with its package installed; it is created if it does not exist."""
    tree = archived(commit)
    own = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}  # it would import this tree
    subprocess.run(["make", "install"], cwd=tree, env=own, check=True)
    return tree


def compare(name: str, before: Player, after: Player, turns: int) -> Comparison:
    """Play in both trees in turn; the order within a pair alternates."""
    play, pairs = PLAYS[name], []
    before.play(play), after.play(play)
    for turn in range(turns):
        order = (before, after) if turn % 2 == 0 else (after, before)
        answers = {player: player.play(play) for player in order}
        pairs.append((answers[before], answers[after]))
    first, second = pairs[0]
    return Comparison(
        name=name,
        steps=second["steps"],
        before=median(old["seconds"] for old, _ in pairs),
        after=median(new["seconds"] for _, new in pairs),
        ratio=median(new["seconds"] / old["seconds"] for old, new in pairs),
        iterations=(first["iterations"], second["iterations"]),
        same=first["digest"] == second["digest"],
    )


def since_table(report: Mapping[str, Any]) -> str:
    """Return the comparisons as a Markdown table."""
    heads = ("program", "steps", f"{report['commit']} [ms a step]", "now [ms a step]", "times as fast", "iterations")
    rows = [
        (item["name"], str(item["steps"]), f"{1e3 * item['before'] / item['steps']:.3g}",
         f"{1e3 * item['after'] / item['steps']:.3g}", f"{1.0 / item['ratio']:.2f}",
         "{} to {}".format(*item["iterations"]))
        for item in report["plays"]
    ]  # fmt: skip
    return markdown_table(heads, rows)


def main() -> None:
    """Compare all plays, print each comparison, write the report and print the table."""
    parser = options("benchmarks.since", __doc__, "since")
    parser.add_argument("commit", help="any name of a commit, or the path of a checkout with its .venv")
    parser.add_argument("plays", nargs="*", metavar="PLAY", help=f"default: all of {', '.join(PLAYS)}")
    parser.add_argument("--turns", type=int, default=TURNS, help=f"pairs of each (default: {TURNS})")
    parser.add_argument("--core", type=int, default=0, help="that both run on (default: 0)")
    arguments = parser.parse_args()
    unknown = set(arguments.plays) - PLAYS.keys()
    if unknown:
        parser.error(f"no play {', '.join(sorted(unknown))}; plays: {', '.join(PLAYS)}")
    given = Path(arguments.commit)
    tree = given.resolve() if (given / ".venv").is_dir() else checkout(arguments.commit)
    players, found = [Player(tree, arguments.core), Player(ROOT, arguments.core)], []
    for name in arguments.plays or PLAYS:
        found.append(compare(name, *players, arguments.turns))
        print(f"{name}: {found[-1].ratio:.3f}{', same bits' * found[-1].same}", file=sys.stderr, flush=True)
    for player in players:
        player.close()
    report = {"commit": arguments.commit, "plays": [asdict(item) for item in found]}
    write_report(arguments.out, report, {})
    print(since_table(report))


if __name__ == "__main__":
    main()

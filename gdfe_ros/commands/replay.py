# SPDX-License-Identifier: Apache-2.0
"""``gdfe replay`` compares a recorded run with its repetition, ``gdfe compare`` with a second recorded run."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.analysis.difference import Comparison, Difference, compare_bags
from gdfe_ros.analysis.difference_table import difference_table, wide_console
from gdfe_ros.analysis.replay import Replay, ReplayReport
from gdfe_ros.commands.options import add_overrides, require_number
from gdfe_ros.commands.waiting import waiting
from gdfe_ros.quantity import Quantity
from gdfe_ros.recording.provenance import describe_machine
from gdfe_ros.scene.override import read_overrides
from gdfe_ros.solver.settings import Policy

DIFFERENT = 1
"""Exit status if arrays differ, or are not compared completely."""
FACTOR = Quantity("factor of the solver's tolerance", least=0.0)
_MOST = 20
"""Largest number of listed keys by which two scenes differ."""


def add_replay(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``replay``."""
    parser.add_argument("bags", nargs="+", type=Path, metavar="BAG", help="directories of bags that sim_node recorded")
    parser.add_argument(
        "--ros",
        action="store_true",
        help="replay through a real sim_node, commanded over topics (default: without ROS)",
    )
    parser.add_argument("--policy", choices=[policy.value for policy in Policy], help="policy instead of the run's")
    parser.add_argument("--tolerance", type=float, help="tolerance of the solver, instead of the run's")
    add_overrides(parser, "override a key of the scene in the bag")
    _add_within(parser, "the run; needed if another kind of machine recorded it, because the last bits then differ")


def _add_within(parser: argparse.ArgumentParser, run: str) -> None:
    text = f"also pass if no difference exceeds FACTOR times the solver tolerance of {run}"
    text = f"{text} (default: all arrays must be bit-identical)"
    parser.add_argument("--within", type=float, default=0.0, metavar="FACTOR", help=text)


def replay(arguments: argparse.Namespace) -> int:
    """Replay bags; return 0 if every bag agrees with its replay, 1 if a bag differs or is not compared completely."""
    require_number("--within", arguments.within, FACTOR)
    overrides = read_overrides(arguments.set)
    overrides |= {
        f"solver.{name}": getattr(arguments, name)
        for name in ("policy", "tolerance")
        if getattr(arguments, name) is not None
    }
    passed = [_replay(path, overrides, arguments.within, ros=arguments.ros) for path in arguments.bags]
    return 0 if all(passed) else DIFFERENT


def _replay(path: Path, overrides: dict[str, object], factor: float, *, ros: bool) -> bool:
    run = BagRun(path)
    with waiting(f"repeating {path}"):
        report = _repeat_by_node(run, overrides) if ros else Replay(run, overrides=overrides).run()
    differences, console = report.differences, wide_console()
    verdict = report.verdict(factor)
    if differences.differing:
        console.print(difference_table(differences, factor=factor))
        first = min((entry.first.key for entry in differences.differing if entry.first), default=None)
        if first is not None:
            console.print(f"first divergent stamp: {1e-9 * first[0]:.9g} s")
        if factor > 0.0:
            console.print(f"smallest factor that passes: {differences.factor_needed():.3g}")
    for text in _remarks(run, report, overrides):
        console.print(text)
    passed = verdict in (Difference.IDENTICAL, Difference.WITHIN)
    text = _describe_incomplete(report, factor) if verdict is Difference.INCOMPLETE else verdict.value
    console.print(
        f"{text}: {path}, {differences.steps} steps, "
        f"{differences.compared} arrays; {report.duration:.3g} s of simulation in {report.wall_time:.3g} s",
        style="green" if passed else "red",
    )
    return passed


def _describe_incomplete(report: ReplayReport, factor: float) -> str:
    if not report.differences.compared:
        return "nothing compared"
    return f"incomplete, {report.differences.verdict(factor).value} as far as it was compared"


def _repeat_by_node(run: BagRun, overrides: dict[str, object]) -> ReplayReport:
    from gdfe_ros.testing.node_replay import NodeReplay

    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    return NodeReplay(run, overrides=overrides).run()


def _remarks(run: BagRun, report: ReplayReport, overrides: dict[str, object]) -> list[str]:
    dropped = run.reader.notes.get("messages_dropped", "0")
    inexact = f"{report.inexact} targets could not be sent to the last bit, because their messages are not in the bag"
    remarks = (
        *((True, f"changed: {key} = {value}") for key, value in overrides.items()),
        (report.cuts, f"{report.cuts} solves whose deadline had passed were ended at the same place"),
        (report.not_converged, f"{report.not_converged} steps did not converge in the replay"),
        (report.unknown, f"not compared, because the replay has none of it: {', '.join(report.unknown)}"),
        (report.inexact, inexact),
        (report.strays, f"not compared, because their step is not in the bag: {dict(report.strays)}"),
        (report.tail, f"messages of an incomplete step at the end of the recording: {dict(report.tail)}"),
        (report.end, report.end),
        (report.differences.unmatched, f"arrays in only one of the runs: {dict(report.differences.unmatched)}"),
        (dropped != "0", f"{dropped} messages were dropped while the bag was recorded"),
    )
    return [text for applies, text in remarks if applies] + _machines(run)


def _machines(run: BagRun) -> list[str]:
    """Return remarks on differences between the recording machine and this one; they change the last bits."""
    there, here = dict(run.reader.run.machine), describe_machine()
    changes = [f"{name} {there[name]} (here {here.get(name)})" for name in there if there[name] != here.get(name)]
    return [f"recorded with {'; '.join(changes)}"] if changes else []


def add_compare(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``compare``."""
    parser.add_argument(
        "first", type=Path, metavar="A", help="directory of a bag that sim_node recorded, or of its run"
    )
    parser.add_argument("second", type=Path, metavar="B", help="directory of another bag, or of its run")
    _add_within(parser, "A")


def compare(arguments: argparse.Namespace) -> int:
    """Compare two runs and print the differences; return 0 if they agree, else 1."""
    require_number("--within", arguments.within, FACTOR)
    comparison = compare_bags(arguments.first, arguments.second)
    differences, console = comparison.differences, wide_console()
    verdict = comparison.verdict(arguments.within)
    for text in _describe_changes(comparison):
        console.print(text)
    if differences.differing:
        console.print(difference_table(differences, factor=arguments.within))
    passed = verdict in (Difference.IDENTICAL, Difference.WITHIN)
    text = f"{verdict.value}: {differences.steps} steps, {differences.compared} arrays compared"
    console.print(text, style="green" if passed else "red")
    return 0 if passed else DIFFERENT


def _describe_changes(comparison: Comparison) -> list[str]:
    """Return remarks on differences beside the arrays: scenes, steps and topics."""
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


COMMANDS = {"replay": (add_replay, replay), "compare": (add_compare, compare)}

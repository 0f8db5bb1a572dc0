# SPDX-License-Identifier: Apache-2.0
"""``gdfe recover``: recover the contents of a truncated bag."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.table import Table

from gdfe_ros.recording.recovery import RecoveryReport, recover
from gdfe_ros.terminal import PlainConsole


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("bag", type=Path, help="directory of the bag, or one MCAP file; it is not changed")
    parser.add_argument(
        "--out", type=Path, help="directory of the new bag (default: <name>_recovered, beside the old one)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Write a new bag with the recovered contents; return 0."""
    report = recover(arguments.bag, arguments.out)
    console = PlainConsole()
    console.print(_table(report))
    for text in _remarks(report):
        console.print(text)
    console.print(f"{report.total} messages in {report.path}", soft_wrap=True)
    return 0


def _table(report: RecoveryReport) -> Table:
    table = Table(title=f"recovered {report.path}", title_justify="left")
    table.add_column("topic")
    table.add_column("messages", justify="right")
    table.add_column("missing before the last one", justify="right")
    for topic, count in report.messages.items():
        table.add_row(topic, str(count), str(report.missing.get(topic, 0)))
    return table


def _remarks(report: RecoveryReport) -> list[str]:
    remarks = [f"{name} was cut off: data after its last complete record are lost" for name in report.cut_files]
    if report.damaged_chunks:
        remarks.append(f"{report.damaged_chunks} chunks did not match their checksum and were left out")
    if report.damaged_records:
        remarks.append(f"{report.damaged_records} other records could not be read and were left out")
    if not report.run:
        remarks.append("its scene is lost: replay and report cannot read the new bag; rosbag2 and Foxglove can")
    if report.orphans:
        remarks.append(f"{report.orphans} messages were left out: the declaration of their topic is lost")
    return remarks or ["the bag was complete"]

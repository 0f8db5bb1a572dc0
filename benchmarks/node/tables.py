# SPDX-License-Identifier: Apache-2.0
"""The tables of ``make bench-node``, printed from bench_node.json; docs/node.md contains the same text."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from benchmarks.markdown import markdown_table

Rows = tuple[tuple[str, ...], list[tuple[str, ...]]]
"""Headings and rows of a table."""


def all_rows(report: Mapping[str, Any]) -> dict[str, Rows]:
    """Return dict from name to headings and rows, for every table of a report."""
    return {
        "latency": latency_rows(report["latency"]),
        "node cost": cost_rows(report["cost"]),
        "idle": idle_rows(report["idle"]),
        "commands": command_rows(report["lockstep"], report["floods"]),
    }


def latency_rows(items: Iterable[Mapping[str, Any]]) -> Rows:
    """Return the table of the times from a command to its mesh."""
    heads = ("elements", "command to mesh, p50 [ms]", "command to mesh, p99 [ms]", "solve, p50 [ms]", "solve, p99 [ms]")
    names = ("p50", "p99", "solve_p50", "solve_p99")
    return heads, [(str(item["elements"]), *(f"{item[name]:.2f}" for name in names)) for item in items]


def cost_rows(items: Iterable[Mapping[str, Any]]) -> Rows:
    """Return the table of the cost of a step in addition to its solve."""
    heads = ("elements", "subscribed", "bag", "step [ms]", "solve [ms]", "solve without node [ms]",
             "time of the node itself [ms]", "its share of the step [%]", "other threads, CPU [ms]")  # fmt: skip
    rows = []
    for item in items:
        times = (f"{item[name]:.2f}" for name in ("period", "solve", "alone", "delay"))
        share, beside = 100 * item["delay"] / item["period"], sum(item["threads"].values())
        subscribed = "mesh, strain" if item["subscribed"] else "nothing"
        bag = "yes" if item["recorded"] else "no"
        rows.append((str(item["elements"]), subscribed, bag, *times, f"{share:.1f}", f"{beside:.2f}"))
    return heads, rows


def idle_rows(items: Iterable[Mapping[str, Any]]) -> Rows:
    """Return the table of the processor time of idle nodes."""
    heads = ("node", "use of one core [%]", "measured for", "meshes published")
    return heads, [
        (item["case"], f"{100 * item['share']:.2f}", f"{item['seconds']:g} s", str(item["meshes"])) for item in items
    ]


def command_rows(lockstep: Mapping[str, Any], floods: Iterable[Mapping[str, Any]]) -> Rows:
    """Return the table of the results of many good and bad commands."""
    heads = (
        "commands", "sent", "accepted", "refused", "commands per second", "all meshes finite", "growth of memory [MB]",
    )  # fmt: skip
    rate = f"{lockstep['sent'] / lockstep['seconds']:.0f}"
    rows = [("good, lockstep", str(lockstep["sent"]), str(lockstep["consumed"]), "0", rate, "", "")]
    for flood in floods:
        rate, finite = f"{flood['sent'] / flood['seconds']:.0f}", "yes" if flood["finite"] else "NO"
        sent, refused = str(flood["sent"]), str(flood["refused"])
        rows.append((f"bad, {flood['scene']}", sent, "0", refused, rate, finite, f"{flood['memory'] / 1e6:.1f}"))
    return heads, rows


def all_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return dict from name to Markdown text, for every table of a report."""
    return {name: markdown_table(*rows) for name, rows in all_rows(report).items()}

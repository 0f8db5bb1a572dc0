# SPDX-License-Identifier: Apache-2.0
"""README: its code runs, its tables are what their scripts print, its pictures and commands exist."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from benchmarks.node import tables as node_tables
from benchmarks.tables import all_tables, replace_tables, tables_beside
from gdfe_ros.cli import COMMANDS
from gdfe_ros.node.reference import markdown
from gdfe_ros.scene import scene_from_text

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text()


def blocks(language: str) -> list[str]:
    """Return the code blocks of a language."""
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.S)


@pytest.mark.parametrize("code", blocks("python"))
def test_python_code_runs(code: str) -> None:
    """Run every Python block, and the tests that it defines: none raises, and each leaves the names that it binds."""
    names: dict[str, object] = {}
    exec(compile(code, "README.md", "exec"), names)
    assert len(names) > len({"__builtins__"}), code
    for name in [name for name in names if name.startswith("test_")]:
        names[name]()


def test_scene_is_valid() -> None:
    """Read the scene that explains the format."""
    assert scene_from_text(blocks("yaml")[0]).mesh.n_cells == 500


def test_node_section_is_generated() -> None:
    """Find the interface table as the package prints it."""
    assert markdown() in README


def test_benchmark_tables_are_those_of_the_report() -> None:
    """Print the tables of the kept reports into README: nothing changes."""
    path = ROOT / "test" / "data" / "bench.json"
    tables = {**all_tables(json.loads(path.read_text())), **tables_beside(path)}
    assert {"robots", "chamber", "threads"} < set(tables)
    assert all(f"<!-- end {name} -->" in README for name in tables)
    assert replace_tables(README, tables) == README


def test_the_table_of_savings_is_that_of_the_report() -> None:
    """Print the table of the kept skip.json into README: nothing changes, and dormant parts save what they should."""
    report = json.loads((ROOT / "test" / "data" / "skip.json").read_text())
    (text,) = all_tables(report).values()
    assert text in README
    ninety = next(row for row in report["savings"] if "10 of 100" in row["scene"])
    assert ninety["elements"] > 20_000
    assert ninety["time_with"] <= 0.25 * ninety["time_without"]
    assert ninety["error"] < 5e-4


def test_torture_tables_are_those_of_the_report() -> None:
    """Print the tables of the kept torture.json into README: nothing changes, and nothing failed."""
    report = json.loads((ROOT / "test" / "data" / "torture.json").read_text())
    tables = all_tables(report)
    assert all(text in README for text in tables.values())
    assert replace_tables(README, tables) == README
    assert {case["verdict"] for case in report["cases"]} == {"converged", "reported", "refused"}


def test_node_tables_are_those_of_the_report() -> None:
    """Print the tables of the kept bench_node.json into README: nothing changes, and every table has its place."""
    report = json.loads((ROOT / "test" / "data" / "bench_node.json").read_text())
    tables = node_tables.all_tables(report)
    assert replace_tables(README, tables, mark=node_tables.MARK) == README
    assert all(node_tables.MARK.format(name=name) in README for name in tables)


def test_pictures_and_commands_exist() -> None:
    """Look up every picture and every subcommand that README names."""
    for picture in re.findall(r"!\[[^]]*\]\(([^)]*)\)", README):
        assert (ROOT / picture).is_file(), picture
    named = set(re.findall(r"`gdfe (\w+)", README))
    assert named <= set(COMMANDS)

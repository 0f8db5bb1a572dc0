# SPDX-License-Identifier: Apache-2.0
"""``make measure``: measured tables, skipped tables, and failing scripts."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest

from benchmarks.measure import __main__ as command
from benchmarks.measure import run as running
from benchmarks.measure import tables
from benchmarks.measure.run import is_current, measure
from benchmarks.measure.tables import NAMES, TABLES, Table
from benchmarks.report import Report, keep, read_report, stamp

GOOD = """
import sys
import time
from pathlib import Path
from benchmarks.report import write_report
print("measuring")
write_report(Path(sys.argv[sys.argv.index("--out") + 1]), ["data"], {"a": 1})
"""
SLOW = """
import subprocess, sys, time
print(subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"]).pid, flush=True)
time.sleep(600)
"""


@pytest.fixture
def table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Table:
    """Return a table whose script is `GOOD`, with its file and log in the test's folder."""
    monkeypatch.setattr(tables, "KEPT", tmp_path)
    monkeypatch.setattr(running, "ROOT", tmp_path)
    monkeypatch.setattr(running, "LOGS", tmp_path / "logs")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    return script(tmp_path, "good", GOOD)


def script(folder: Path, name: str, text: str) -> Table:
    """Write a module; return the table whose script it is."""
    (folder / f"{name}_script.py").write_text(text)
    return Table(name=name, module=f"{name}_script", minutes=1)


def test_a_table_is_measured_once(table: Table, capsys: pytest.CaptureFixture[str]) -> None:
    """A table is measured once, with this solver's mark, and not again unless that is requested."""
    assert not is_current(table)
    assert measure(table) is None
    assert read_report(table.file) == Report(["data"], stamp(), {"a": 1})
    if not stamp().commit.endswith("+"):
        assert is_current(table)
        assert not command.is_wanted(table, again=False)
        assert command.is_wanted(table, again=True)
        assert "skipped: good: of this solver already" in capsys.readouterr().out


def test_a_file_of_another_form_is_measured_again(table: Table) -> None:
    """A file in the former format, bare rows, is not current and is measured again."""
    table.file.write_text("[]")
    assert not is_current(table)
    assert measure(table) is None


def test_a_failure_does_not_stop_the_others(table: Table, tmp_path: Path) -> None:
    """With a failing script, an empty one and a good one, two are reported, and kept files stay."""
    bad = script(tmp_path, "bad", "raise SystemExit('no such robot')")
    silent = script(tmp_path, "silent", "")
    keep(bad.file, Report(["old"], stamp(), {}))
    failures = command.run([bad, silent, table])
    assert failures == [
        "bad: ended with status 1; its table is as it was; see logs/bad.log: no such robot",
        "silent: ended with status 0; its table is as it was; see logs/silent.log: it printed nothing",
    ]
    assert read_report(bad.file).data == ["old"]
    assert read_report(table.file).data == ["data"]


def test_a_script_that_hangs_is_ended(table: Table, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A script that exceeds its time is ended with the process that it has started, and reported."""
    monkeypatch.setattr(running, "LEAST", 0.05)
    monkeypatch.setattr(running, "PATIENCE", 0.01)
    slow = script(tmp_path, "slow", SLOW)
    reason = measure(slow)
    assert reason is not None
    assert reason.startswith("took too long and was ended")
    other = int((running.LOGS / "slow.log").read_text().split()[0])
    for _ in range(100):
        if not alive(other):
            break
        time.sleep(0.05)
    assert not alive(other)


def alive(pid: int) -> bool:
    """Return whether a process runs; a zombie does not."""
    status = Path(f"/proc/{pid}/stat")
    return status.is_file() and status.read_text().rpartition(")")[2].split()[0] != "Z"


def test_what_is_not_installed_is_skipped(table: Table, capsys: pytest.CaptureFixture[str]) -> None:
    """A table that needs a missing package is skipped by name, even if all tables are requested again."""
    lacking = Table(name="lacking", module=table.module, minutes=1, needs=("no_such_package",))
    assert not command.is_wanted(lacking, again=True)
    assert "skipped: lacking: not installed: no_such_package" in capsys.readouterr().out


def test_every_table_has_a_script_and_a_probe() -> None:
    """Every table's script and probe exist, names are unique, and all take at most 85 minutes."""
    assert len(set(NAMES)) == len(NAMES)
    for item in TABLES:
        assert item.missing() or callable(item.probe), item.name
    assert sum(item.minutes for item in TABLES) <= 85.0


def test_the_list_shows_every_table(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The list shows each table with its minutes, and the total."""
    monkeypatch.setattr(sys, "argv", ["measure", "--list"])
    assert command.main() == 0
    shown = capsys.readouterr().out
    assert all(name in shown for name in (*NAMES, "all"))

# SPDX-License-Identifier: Apache-2.0
"""Files of measurements: their origin, their completeness, and when they are stale."""

from __future__ import annotations

import re
import subprocess
from datetime import date
from pathlib import Path

import pytest

from benchmarks import provenance
from benchmarks.provenance import Provenance, ProvenanceError, solver_commit, stamp
from benchmarks.report import Report, read_report, write_report

MADE = Provenance("5eecb34", "2026-11-23", "AMD EPYC, 2 cores, Python 3.11.7, numba 0.68.1")


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a git checkout with a solver and a page, each in its own commit."""
    monkeypatch.setattr(provenance, "ROOT", tmp_path)
    solver_commit.cache_clear()
    monkeypatch.setattr("benchmarks.provenance.solver_commit", solver_commit.__wrapped__)
    git(tmp_path, "init", "-q")
    for name in ("gdfe_ros", "docs"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "file").write_text(name)
        git(tmp_path, "add", ".")
        git(tmp_path, "-c", "user.name=n", "-c", "user.email=e", "commit", "-qm", name)
    return tmp_path


def git(folder: Path, *words: str) -> str:
    """Run git in a folder; return its output."""
    return subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True, check=True).stdout.strip()


def test_the_commit_is_that_of_the_solver(checkout: Path) -> None:
    """The commit of a measurement is the solver's, not a later page's, and is marked if a solver file has changed."""
    first = git(checkout, "rev-list", "--max-parents=0", "HEAD")[:7]
    assert provenance.solver_commit() == first
    (checkout / "docs" / "file").write_text("other")
    assert provenance.solver_commit() == first
    assert Provenance(first, "", "").is_current
    (checkout / "gdfe_ros" / "file").write_text("other")
    assert provenance.solver_commit() == first + "+"
    assert not Provenance(first + "+", "", "").is_current


def test_words_do_not_make_another_solver(checkout: Path) -> None:
    """A new docstring leaves a measurement current, new code does not."""
    codes = ['"""Old."""\nX = 1\n', '"""New."""\nX = 1  # one\n', '"""New."""\nX = 2\n']
    made = []
    for code in codes:
        (checkout / "gdfe_ros" / "file.py").write_text(code)
        git(checkout, "add", ".")
        git(checkout, "-c", "user.name=n", "-c", "user.email=e", "commit", "-qm", "code")
        made.append(Provenance(provenance.solver_commit(), "", ""))
        assert made[-1].is_current
        if len(made) == 2:
            assert made[0].is_current
    assert not made[0].is_current
    assert not Provenance("0000000", "", "").is_current


def test_no_checkout_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Outside of a checkout, the commit is an error that says where, why, and what to do."""
    monkeypatch.setattr(provenance, "ROOT", tmp_path)
    with pytest.raises(ProvenanceError, match=rf"{re.escape(str(tmp_path))}.*measure in a git checkout"):
        provenance.solver_commit.__wrapped__()


def test_the_stamp_is_of_today_and_of_this_machine() -> None:
    """The stamp is one line with a commit, a day, a processor, cores and versions."""
    made = stamp()
    assert re.fullmatch(r"[0-9a-f]{7}\+?", made.commit)
    assert made.date == date.today().isoformat()
    assert re.fullmatch(r".+, \d+ cores?, Python \S+, numba \S+", made.machine)
    assert made.line == f"*Measured {made.date} at {made.commit} on {made.machine}.*"


def test_a_report_survives_its_file(tmp_path: Path) -> None:
    """Data and probe of a report are read back as written, and no other file is left."""
    path = tmp_path / "new" / "rows.json"
    write_report(path, [{"a": 1.5}], {"iterations": 7, "kind": "Fronts"})
    found = read_report(path)
    assert (found.data, found.probe, found.made) == ([{"a": 1.5}], {"iterations": 7, "kind": "Fronts"}, stamp())
    assert [item.name for item in path.parent.iterdir()] == ["rows.json"]


def test_a_report_that_cannot_be_written_leaves_the_old_one(tmp_path: Path) -> None:
    """Data that are no JSON raise an error, and the old report stays."""
    path = tmp_path / "rows.json"
    write_report(path, [1], {"a": 1})
    with pytest.raises(TypeError, match="cannot hold"):
        write_report(path, [object()], {"a": 2})
    assert read_report(path).data == [1]


def test_another_form_is_refused(tmp_path: Path) -> None:
    """A file with bare rows is refused with its name and a remedy."""
    path = tmp_path / "robots.json"
    path.write_text("[]")
    with pytest.raises(ValueError, match=r"robots.json .* make measure ONLY=robots"):
        read_report(path)


@pytest.mark.parametrize(
    ("now", "stale"),
    [
        ({"iterations": 100, "kind": "Fronts"}, []),
        ({"iterations": 109, "kind": "Fronts"}, []),
        ({"iterations": 115, "kind": "Fronts"}, ["iterations"]),
        ({"iterations": 85, "kind": "Fronts"}, ["iterations"]),
        ({"iterations": 100, "kind": "Band"}, ["kind"]),
        ({"kind": "Fronts"}, ["iterations"]),
        ({"iterations": 100, "kind": "Fronts", "error": 0.1}, ["error"]),
    ],
)
def test_what_differs_by_more_than_a_tenth_is_stale(now: dict[str, float | str], stale: list[str]) -> None:
    """A probe is stale if a figure differs by more than a tenth, a text differs, or one is missing."""
    report = Report([], MADE, {"iterations": 100, "kind": "Fronts"})
    assert [text.partition(":")[0] for text in report.stale(now)] == stale

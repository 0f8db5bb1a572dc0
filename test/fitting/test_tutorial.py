# SPDX-License-Identifier: Apache-2.0
"""The page "Fit a model to your robot": its files and commands work as printed."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest

from gdfe_ros.cli import main

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "fitting.md").read_text(encoding="utf-8")


def _commands(word: str) -> list[list[str]]:
    """Return the page's commands that contain a word, each as arguments without the program."""
    code = "\n".join(re.findall(r"^```sh\n(.*?)^```", PAGE, flags=re.S | re.M))
    return [shlex.split(line)[1:] for line in code.replace("\\\n", " ").splitlines() if word in line]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Write the page's files into the working folder."""
    files = dict(re.findall(r"`(\w+\.(?:csv|yaml))`:\n\n```\w+\n(.*?)^```", PAGE, flags=re.S | re.M))
    assert set(files) == {"skin.csv", "beam.yaml", "hung.csv", "match.yaml", "swing.yaml"}
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_material_is_made(folder: Path) -> None:
    """The page's tensile test writes an entry and a picture."""
    (command,) = _commands("--tensile skin.csv")
    assert main(command) == 0
    assert "mu: [42327" in (folder / "skin" / "material.yaml").read_text()
    assert (folder / "skin" / "tensile.png").is_file()


def test_the_sagging_beam_is_fitted(folder: Path) -> None:
    """The page's fit of equilibria gives the printed modulus and every listed file; its charts are over rows."""
    (command,) = _commands("beam.yaml hung.csv")
    assert main([*command, "--workers", "1"]) == 0
    found = json.loads((folder / "beam_fit" / "fit.json").read_text())["parameters"]["materials.silicone.young"]
    assert round(found["value"], -3) == 242e3
    rows = re.findall(
        r"^\| `([\w.]+)` \|", PAGE.partition("these files to `beam_fit/`")[2].partition("## ")[0], flags=re.M
    )
    assert sorted(rows) == sorted(path.name for path in (folder / "beam_fit").iterdir())
    page = (folder / "beam_fit" / "fit.html").read_text(encoding="utf-8")
    assert '"text":"row"' in page
    assert '"text":"time [s]"' not in page
    assert (folder / "beam_fit" / "residuals.csv").read_text().startswith("recording,series,held_out,row,")


def test_the_workspace_is_found(folder: Path) -> None:
    """The page's workspace, with fewer commands, has a table and a picture."""
    (command,) = _commands("workspace tendon_finger")
    assert main([*command, "--count", "4", "--workers", "1"]) == 0
    assert {path.name for path in (folder / "reach").iterdir()} == {"workspace.csv", "workspace.png"}


@pytest.mark.slow
def test_the_measured_beam_is_fitted_and_predicted(folder: Path) -> None:
    """The page's fit to the swing without load predicts the swings with 52 and 101 g."""
    (command,) = _commands("fit silicone_beam")
    command = [str(ROOT / word) if word.startswith("test/") else word for word in command]
    assert main(command) == 0
    found = json.loads((folder / "swing_fit" / "fit.json").read_text())
    assert found["parameters"]["materials.silicone.young"]["value"] == pytest.approx(272e3, rel=0.02)
    misfits = {item["recording"]: item["relative"] for item in found["recordings"]}
    assert misfits["beam_0g"] < 0.05
    assert max(misfits["beam_52g"], misfits["beam_101g"]) < 0.12
    assert any("residuals are structured" in text for text in found["warnings"])

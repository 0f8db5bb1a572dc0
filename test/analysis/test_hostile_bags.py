# SPDX-License-Identifier: Apache-2.0
"""Bags that someone else made to harm: each command refuses them in a line, soon, and without a traceback."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from gdfe_ros.cli import BAD_INPUT, main
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.recording.step import ENERGIES
from test.analysis.conftest import rewrite
from test.untrusted.test_bounded_text import BOMB

PATIENCE = 20.0
"""Longest processor time of a refusal [s], with the imports of a command; without limits, it was minutes."""
COMMANDS = {
    "replay": lambda bag: ["replay", bag],
    "export": lambda bag: ["export", bag, "--out", f"{bag}.csv"],
    "report": lambda bag: ["report", bag, "--out", f"{bag}.html"],
}


def _entries(change: Callable[[dict[str, Any]], object]) -> Callable[[str], str]:
    """Return a function that changes the entries of a step's record."""

    def edit(text: str) -> str:
        entries = json.loads(text)
        change(entries)
        return json.dumps(entries)

    return edit


RECORDS: dict[str, Callable[[str], str]] = {
    "a step of 1e308 s": _entries(lambda entries: entries.update(dt=1e308)),
    "a negative step": _entries(lambda entries: entries.update(dt=-1.0)),
    "a time that is text": _entries(lambda entries: entries.update(time="soon")),
    "deep nesting": lambda text: "[" * 200_000,
    "a long number": lambda text: text.replace('"dt": ', '"dt": ' + "1" * 60_000, 1),
    "a list": lambda text: "[1, 2]",
    "handles that are a list": _entries(lambda entries: entries.update(handles=[1])),
    "a pose of two numbers": _entries(lambda entries: entries.update(handles={"tip": [1, 2]})),
    "a pose of texts": _entries(lambda entries: entries.update(handles={"tip": list("abcdef")})),
    "a command that is NaN": _entries(lambda entries: entries.update(actuators={"tip": float("nan")})),
    "a cut that is text": _entries(lambda entries: entries.update(cut_after="x")),
    "a message that erases the terminal": _entries(lambda entries: entries.update(message="\x1b[2J")),
    "skipped work named by a command of the terminal": _entries(lambda entries: entries.update(skipped={"\x9b31m": 1})),
    "energies without names": _entries(lambda entries: entries.update(energies={"heat": 1.0})),
    "energies that are texts": _entries(lambda entries: entries.update(energies=dict.fromkeys(ENERGIES, "1"))),
    "skipped work that is a list": _entries(lambda entries: entries.update(skipped=[1])),
    "a number beyond 64 bits": _entries(lambda entries: entries.update(stamp=10**30)),
}
RUNS: dict[str, Callable[[RunInfo], RunInfo]] = {
    "settings that are a list": lambda run: replace(run, settings=[1, 2]),
    "a machine that is a text": lambda run: replace(run, machine="x"),
    "a machine that erases the terminal": lambda run: replace(run, machine={**run.machine, "processor": "\x1b[2J"}),
    "a node's settings that are a list": lambda run: replace(run, settings={**run.settings, "node": [1]}),
    "a scene that is a bomb": lambda run: replace(run, scene=BOMB),
    "a scene with a long number": lambda run: replace(run, scene="name: " + "1" * 60_000),
    "a scene named like a path": lambda run: replace(run, scene=run.scene.replace("name: bend5", "name: ../../evil")),
    "a scene that is empty": lambda run: replace(run, scene=""),
}


CHANGES: dict[str, dict[str, Callable[[Any], Any]]] = {
    **{name: {"record": change} for name, change in RECORDS.items()},
    **{name: {"run": change} for name, change in RUNS.items()},
    "a definition of 16 MB": {"topic": lambda topic: replace(topic, definition=topic.definition + "\n# x" * 4_000_000)},
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_hostile_bag_is_refused(
    make_bag: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    """A value that no step can have, a scene or settings of another type, or what takes long to read, is refused."""
    bag = rewrite(make_bag(heights=[0.0, 0.01]), tmp_path / "hostile", **CHANGES[name])
    for command in COMMANDS.values():
        began = time.process_time()
        status = main(command(str(bag)))
        assert time.process_time() - began < PATIENCE
        told = capsys.readouterr()
        assert status in (0, 1, BAD_INPUT)
        assert "Traceback" not in told.err
        assert len(told.err) < 5000
    assert status == BAD_INPUT, "a command may read no such part, but not the last one"

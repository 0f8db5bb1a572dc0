# SPDX-License-Identifier: Apache-2.0
"""``gdfe solve`` at the end of what can be solved, and interrupted."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from gdfe_ros import Command, Simulation, load_scene
from gdfe_ros.cli import main
from gdfe_ros.scene.override import read_overrides
from test.written import advance

BAR = """
name: pulled
mesh: {bar: {size: [0.08, 0.02, 0.02], cells: [4, 1, 1]}}
materials: {rubber: {law: neo_hookean, young: 1.0e5, poisson: 0.45}}
regions: [{material: rubber}]
handles: {base: {where: {face: x-}, fixed: true}, tip: {where: {face: x+}}}
solver: {steps: 4, max_iterations: ITERATIONS}
program:
  duration: 1.0
  handles: {tip: [{time: 0.0}, {time: 1.0, translation: [0.0, 0.0, 0.04]}]}
"""

CHAMBER = """
name: soft_chamber
mesh:
  bar:
    size: [0.04, 0.02, 0.02]
    cells: [8, 4, 4]
    cut: [{box: {x: [0.005, 0.035], y: [-0.005, 0.005], z: [-0.005, 0.005]}}]
materials: {ecoflex: {preset: ecoflex_00_30}}
regions: [{material: ecoflex}]
handles: {base: {where: {face: x-}, fixed: true}}
actuators: {air: {chamber: {command: pressure, range: [0.0, 3.0e4]}}}
program: {duration: 1.0, actuators: {air: [{time: 0.0, value: 0.0}, {time: 1.0, value: 2.0e4}]}}
"""
"""A chamber of Ecoflex at 20 kPa; its pressure has its maximum at 8.3 kPa."""


PRESSED = """
name: pressed
mesh: {bar: {size: [0.08, 0.02, 0.02], cells: [8, 2, 2]}}
materials: {rubber: {law: neo_hookean, young: 1.0e5, poisson: 0.45}}
regions: [{material: rubber}]
handles: {base: {where: {face: x-}, fixed: true}}
obstacles: {table: {box: {size: [0.03, 0.04, 0.02]}, at: [0.07, 0, -0.0201]}}
sensors: {pad: {where: {face: z-}}}
program: {duration: 1.0, obstacles: {table: [{time: 0.0}, {time: 1.0, translation: [0.0, 0.0, 0.002]}]}}
"""
"""A cantilever whose underside a box pushes up."""


def _scene(folder: Path, iterations: int) -> str:
    path = folder / "pulled.yaml"
    path.write_text(BAR.replace("ITERATIONS", str(iterations)), encoding="utf-8")
    return str(path)


def _meta(path: Path) -> dict[str, object]:
    with np.load(path) as stored:
        return json.loads(str(stored["meta"]))


@pytest.mark.parametrize(("going", "steps"), [([], 1), (["--keep-going"], 4)])
def test_a_failed_step_ends_the_run(
    going: list[str], steps: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The run stops at the first step that fails, or goes on if asked; table and file mark the failed state."""
    out = tmp_path / "last.npz"
    assert main(["solve", _scene(tmp_path, 1), "--out", str(out), *going]) == 3
    printed = capsys.readouterr()
    assert (_meta(out)["steps"], _meta(out)["converged"]) == (steps, False)
    assert "its values are no equilibrium" in " ".join(printed.out.split())
    assert ("--keep-going" in printed.err) is (not going)


def test_an_ending_that_cannot_be_written_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A result named .csv is refused before the scene is solved, with the ending that can be written."""
    assert main(["solve", _scene(tmp_path, 2000), "--out", str(tmp_path / "last.csv")]) == 2
    assert "unknown format '.csv'; allowed: .npz" in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "last.csv").exists()


def test_an_interrupt_leaves_what_was_solved(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """After Ctrl-C in the third step, table, picture and file show the second one."""
    out, picture, step, calls = tmp_path / "last.npz", tmp_path / "last.png", Simulation.step, []

    def interrupted(*given: object, **named: object) -> object:
        calls.append(1)
        if len(calls) == 4:  # the first one warms up
            raise KeyboardInterrupt  # a real signal would also reach what runs the tests in this process
        return step(*given, **named)

    monkeypatch.setattr(Simulation, "step", interrupted)
    assert main(["solve", _scene(tmp_path, 2000), "--out", str(out), "--picture", str(picture)]) == 130
    printed = capsys.readouterr()
    assert (_meta(out)["steps"], _meta(out)["converged"], _meta(out)["whole"]) == (2, True, False)
    assert picture.stat().st_size > 0
    assert "interrupted after t = 0.5 s" in printed.err
    assert "converged" in printed.out


def test_a_pressure_beyond_the_limit_names_limit_and_remedy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A chamber beyond its limit pressure: the command names the limit, and table, picture and file mark the state."""
    path, out, picture = tmp_path / "chamber.yaml", tmp_path / "last.npz", tmp_path / "last.png"
    path.write_text(CHAMBER, encoding="utf-8")
    assert main(["solve", str(path), "--out", str(out), "--picture", str(picture)]) == 3
    printed = capsys.readouterr()
    found = re.search(r"no equilibrium found beyond air = (\d+) Pa, before t = 1 s;", printed.err)
    assert "its pressure falls with its volume there; remedy: command its volume instead" in printed.err
    assert "the values are those of the last equilibrium before its command" in " ".join(printed.out.split())
    assert picture.stat().st_size > 0
    with np.load(out) as stored:
        limit, volume = stored["actuator_air"][0], stored["actuator_air"][1]
        assert not json.loads(str(stored["meta"]))["converged"]
    assert float(found[1]) == pytest.approx(limit, rel=1e-3)
    # The remedy works: with commanded volumes, the pressure has its maximum near the limit, and falls.
    commanded = load_scene(path, overrides=read_overrides(["actuators.air.chamber.command=volume", "program=null"]))
    simulation, pressures = Simulation(commanded), []
    for ratio in (1.0, 1.4, 1.9):
        result = advance(simulation, Command(actuators={"air": ratio * volume}))
        pressures.append(result.actuators["air"].effort)
    assert max(pressures) == pressures[1] == pytest.approx(limit, rel=0.02)


def test_the_table_has_the_readings_of_sensors(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A contact sensor on the underside reads the force of the box that pushes it up, as the box' own row has it."""
    (tmp_path / "pressed.yaml").write_text(PRESSED, encoding="utf-8")
    assert main(["solve", str(tmp_path / "pressed.yaml"), "--steps", "2"]) == 0
    rows = {name: forces for name, forces in re.findall(r"│ ([\w ]+): force +│ ([^│]+)│", capsys.readouterr().out)}
    read, pushed = (np.array(rows[name].split(), dtype=float) for name in ("sensor pad", "table"))
    assert read[2] > 1e-3
    np.testing.assert_allclose(read, pushed, atol=1e-4 * read[2])

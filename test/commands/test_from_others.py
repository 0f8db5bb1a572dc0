# SPDX-License-Identifier: Apache-2.0
"""The pages "Coming from SOFA", "from MuJoCo" and "from Abaqus": their files, commands and code work as printed."""

from __future__ import annotations

import math
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from gdfe_ros import Command, Simulation, load_scene
from gdfe_ros.cli import main
from gdfe_ros.errors import SceneError
from gdfe_ros.materials import NeoHookean, Yeoh

DOCS = Path(__file__).parents[2] / "docs"


def _blocks(page: str, language: str) -> list[str]:
    text = (DOCS / page).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.S | re.M)


def _run(block: str) -> None:
    for line in block.splitlines():
        assert main(shlex.split(line)[1:]) == 0, line


def _add(path: str, entries: str) -> None:
    """Add entries of a page to a scene file."""
    scene = yaml.safe_load(Path(path).read_text()) | yaml.safe_load(entries)
    Path(path).write_text(yaml.safe_dump(scene))


DRAW = """
import gmsh
gmsh.initialize()
gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 80.0, 8.0)
gmsh.model.occ.synchronize()
gmsh.write("stalk.step")
"""


def test_a_robot_of_sofa_from_its_drawing_to_a_fitted_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The stalk bends towards the cable that is pulled, and the fit finds the modulus of the recording."""
    monkeypatch.chdir(tmp_path)
    subprocess.run([sys.executable, "-c", DRAW], check=True, capture_output=True)
    make, solve, fit, _ = _blocks("from_sofa.md", "sh")
    entries, match, _ = _blocks("from_sofa.md", "yaml")
    _run(make)
    _add("stalk.yaml", entries)
    _run(solve)
    assert Path("stalk.png").stat().st_size > 10_000
    Path("match.yaml").write_text(match)
    truth = Simulation(load_scene("stalk.yaml", overrides={"materials.body.young": 2.2e5}))
    rows = ["time,pull_0,pull_1,x,y,z"]
    for time, pulls in enumerate([(0.0, 0.0), (0.15, 0.0), (0.3, 0.0), (0.3, 0.2)]):
        assert truth.step(Command(actuators=dict(zip(("pull_0", "pull_1"), pulls, strict=True)))).converged
        rows.append(",".join(map(str, (time, *pulls, *truth.probe_positions()["tip"]))))
    assert float(rows[3].split(",")[3]) > 0.005
    Path("pull.csv").write_text("\n".join(rows) + "\n")
    _run(fit)
    assert load_scene("fitted/scene.yaml").materials["body"].young == pytest.approx(2.2e5, rel=5e-3)


def test_a_cable_with_friction_is_three_cables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The tensions of the page obey the capstan equation, and the base bears the tension of the motor alone."""
    monkeypatch.chdir(tmp_path)
    text = _blocks("from_sofa.md", "yaml")[2]
    Path("bends.yaml").write_text(text)
    _run(_blocks("from_sofa.md", "sh")[3])
    given = [rows[-1]["value"] for rows in yaml.safe_load(text)["program"]["actuators"].values()]
    assert given == pytest.approx([0.5 * math.exp(-0.2 * k * math.pi / 2) for k in range(3)], rel=2e-3)
    simulation = Simulation(load_scene("bends.yaml"))
    result = simulation.step(Command(actuators=dict(zip(("motor", "middle", "end"), given, strict=True))))
    assert np.linalg.norm(result.reactions["base"][:3]) == pytest.approx(0.5, rel=1e-4)
    friction = {"actuators.motor.cable.friction": 0.2}
    with pytest.raises(SceneError, match=r"a cable has none.*remedy, while it is pulled: a cable for each stretch"):
        load_scene("bends.yaml", overrides=friction)


def test_a_flex_of_mujoco(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The scene of the page plays, its code runs, and the state that was restored is the one that was kept."""
    monkeypatch.chdir(tmp_path)
    (scene,), (solve,), (code,) = (_blocks("from_mujoco.md", kind) for kind in ("yaml", "sh", "py"))
    Path("flex.yaml").write_text(scene)
    _run(solve)
    found: dict[str, Any] = {}
    exec(code, found)
    assert found["result"].converged
    assert found["simulation"].time == pytest.approx(0.1)


def test_a_model_of_abaqus(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All commands of the page end with 0, and the scene with its entries sags by its weight where the instance is."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(DOCS.parent / "test" / "data" / "cases" / "abaqus" / "moved_instance.inp", "finger.inp")
    (first, last), (entries,) = (_blocks("from_abaqus.md", kind) for kind in ("sh", "yaml"))
    _run(first)
    _add("finger.yaml", entries)
    _run(last)
    assert Path("finger.png").stat().st_size > 10_000
    loaded = load_scene("finger.yaml")
    assert isinstance(loaded.materials["body"], Yeoh)
    simulation = Simulation(loaded)
    assert simulation.step().converged
    moved = simulation.positions - loaded.mesh.vertices
    assert loaded.mesh.bounds[0, 0] == pytest.approx(0.1)
    assert moved[:, 2].min() == pytest.approx(-5.1e-3, rel=0.15)  # w L^4 / (8 E I) of a slender beam
    weight = 1070 * 2e-5 * 9.81
    assert simulation.result.reactions["base"][2] == pytest.approx(weight, rel=1e-3)


def test_the_formulas_of_the_page_about_abaqus_are_right() -> None:
    """Young's modulus from C10, and Poisson's ratio from D1, give the shear and bulk moduli of Abaqus' manual."""
    c10, d1 = 2.0e4, 1.0e-6
    bulk, shear = 2.0 / d1, 2.0 * c10
    poisson = (3.0 * bulk - 2.0 * shear) / (6.0 * bulk + 2.0 * shear)
    material = NeoHookean(young=4.0 * (1.0 + poisson) * c10, poisson=poisson)
    np.testing.assert_allclose([material.shear0, material.bulk], [shear, bulk], rtol=1e-12)

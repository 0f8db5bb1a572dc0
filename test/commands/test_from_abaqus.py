# SPDX-License-Identifier: Apache-2.0
"""The page "Coming from Abaqus": its commands and its entries work as printed, and its formulas are right."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

from gdfe_ros import Simulation, load_scene
from gdfe_ros.cli import main
from gdfe_ros.materials import NeoHookean, Yeoh

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "from_abaqus.md").read_text(encoding="utf-8")


def test_the_commands_of_the_page_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All commands end with 0, and the scene with the page's entries sags by its weight where the instance is."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(ROOT / "test" / "data" / "cases" / "abaqus" / "moved_instance.inp", "finger.inp")
    first, last = re.findall(r"^```sh\n(.*?)^```", PAGE, flags=re.S | re.M)
    for line in first.splitlines():
        assert main(shlex.split(line)[1:]) == 0, line
    (entries,) = re.findall(r"^```yaml\n(.*?)^```", PAGE, flags=re.S | re.M)
    scene = yaml.safe_load(Path("finger.yaml").read_text()) | yaml.safe_load(entries)
    Path("finger.yaml").write_text(yaml.safe_dump(scene))
    assert main(shlex.split(last)[1:]) == 0
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


def test_the_formulas_of_the_page_are_right() -> None:
    """Young's modulus from C10, and Poisson's ratio from D1, give the shear and bulk moduli of Abaqus' manual."""
    c10, d1 = 2.0e4, 1.0e-6
    bulk, shear = 2.0 / d1, 2.0 * c10
    poisson = (3.0 * bulk - 2.0 * shear) / (6.0 * bulk + 2.0 * shear)
    material = NeoHookean(young=4.0 * (1.0 + poisson) * c10, poisson=poisson)
    np.testing.assert_allclose([material.shear0, material.bulk], [shear, bulk], rtol=1e-12)

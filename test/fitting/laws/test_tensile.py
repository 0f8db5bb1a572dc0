# SPDX-License-Identifier: Apache-2.0
"""Laws from tensile tests: known laws are found again, unstable ones are refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from gdfe_ros.cli import main
from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.laws.tensile import fit_tensile
from gdfe_ros.materials import LIBRARY, Law, preset
from gdfe_ros.scene import scene_from_text

STRAIN = np.linspace(0.05, 2.0, 40)
BAR = """\
name: bar
mesh: {bar: {size: [0.02, 0.01, 0.01], cells: [2, 1, 1]}}
regions: [{material: rubber}]
handles: {base: {where: {face: x-}, fixed: true}}
"""


def _write(path: Path, strain: np.ndarray, stress: np.ndarray) -> Path:
    rows = "\n".join(f"{e!r},{s!r}" for e, s in zip(strain.tolist(), stress.tolist(), strict=True))
    path.write_text(f"strain,stress\n{rows}\n")
    return path


def test_table_one_comes_back() -> None:
    """Ogden's law fitted to NinjaFlex (Table 1) has the six constants within their last printed digit."""
    stress = preset("ninjaflex", law=Law.OGDEN, poisson=0.495).stress_at(STRAIN)
    found = fit_tensile(STRAIN, stress, law=Law.OGDEN, terms=3)
    order = np.argsort(LIBRARY["ninjaflex"].alpha)
    np.testing.assert_allclose(found.entry["mu"], np.array(LIBRARY["ninjaflex"].mu)[order], rtol=0, atol=0.5)
    np.testing.assert_allclose(found.entry["alpha"], np.array(LIBRARY["ninjaflex"].alpha)[order], rtol=0, atol=5e-7)


@pytest.mark.parametrize("name", ["ninjaflex", "cheetah"])
def test_polynomials_of_section_five_come_back(name: str) -> None:
    """Polynomials of degree six fitted to the printed ones have their coefficients within the last printed digit."""
    material = preset(name, law=Law.CURVE, poisson=0.495)
    found = fit_tensile(STRAIN, material.stress_at(STRAIN), law=Law.CURVE)
    np.testing.assert_allclose(found.entry["coefficients"], material.data.coefficients, rtol=0, atol=0.005e6)


def test_an_unstable_law_is_refused_by_name() -> None:
    """Cheetah's three terms (Table 1), which are unstable, are refused with law, deformation and remedy."""
    stress = preset("cheetah", law=Law.OGDEN, poisson=0.495).stress_at(STRAIN)
    with pytest.raises(GdfeError, match=r"ogden with 3 terms.*unstable in uniaxial compression.*remedy: --terms 1"):
        fit_tensile(STRAIN, stress, law=Law.OGDEN, terms=3)
    found = fit_tensile(STRAIN, stress, law=Law.OGDEN)
    assert found.material.remarks() == []
    assert [text.partition(",")[0] for text in found.refused] == ["ogden with 2 terms", "ogden with 3 terms"]


@pytest.mark.parametrize("name", [name for name, recipe in LIBRARY.items() if recipe.misfit is not None])
def test_the_library_is_what_its_data_say(name: str) -> None:
    """One term fitted to each silicone's points gives the library's constants and misfit, and is stable."""
    recipe = LIBRARY[name]
    found = fit_tensile(recipe.curve.strain, recipe.curve.stress, law=Law.OGDEN, terms=1)
    assert found.entry["mu"] == pytest.approx(list(recipe.mu), rel=1e-4)
    assert found.entry["alpha"] == pytest.approx(list(recipe.alpha), abs=1e-4)
    assert found.largest == pytest.approx(recipe.misfit, abs=3e-4)
    assert found.material.remarks() == []


@pytest.mark.parametrize("law", [Law.LINEAR, Law.NEO_HOOKEAN])
def test_a_modulus_comes_back_through_noise(law: Law) -> None:
    """The modulus of a curve with 1 % noise is found within 0.5 %."""
    noise = 1.0 + 0.01 * np.random.default_rng(1).standard_normal(STRAIN.size)
    stress = {Law.LINEAR: 2e5 * STRAIN, Law.NEO_HOOKEAN: 2e5 / 3.0 * ((1 + STRAIN) - (1 + STRAIN) ** -2.0)}[law]
    assert fit_tensile(STRAIN, stress * noise, law=law).entry["young"] == pytest.approx(2e5, rel=0.005)


@pytest.mark.parametrize(
    ("strain", "stress", "message"),
    [
        (STRAIN, STRAIN * 264.0, "give stress in Pa"),
        (100.0 * STRAIN, STRAIN * 2e5, "100 % is 1.0"),
        (STRAIN, np.full(STRAIN.size, 3e4), "do not move"),
        (STRAIN[:2], STRAIN * 2e5, "equal length"),
        (STRAIN, -2e5 * STRAIN, "check the signs"),
    ],
)
def test_what_cannot_be_a_test_is_refused(strain: np.ndarray, stress: np.ndarray, message: str) -> None:
    """Kilopascals, percent, a flat line, columns of two lengths and a wrong sign are refused with a remedy."""
    with pytest.raises(GdfeError, match=message):
        fit_tensile(strain, stress, law=Law.LINEAR)


def test_the_command_makes_a_material(tmp_path: Path, capsys: Any) -> None:
    """From a csv file the command writes a material entry that a scene accepts, and a picture."""
    curve = _write(tmp_path / "skin.csv", STRAIN, preset("ninjaflex", law=Law.OGDEN, poisson=0.4).stress_at(STRAIN))
    out = tmp_path / "out"
    given = ["fit", "--tensile", str(curve), "--law", "ogden", "--terms", "3", "--density", "1190", "--out", str(out)]
    assert main(given) == 0
    assert "stability" in capsys.readouterr().out
    entry = yaml.safe_load((out / "material.yaml").read_text())
    scene = scene_from_text(BAR, overrides={"materials": {"rubber": entry["skin"]}})
    given = preset("ninjaflex", law=Law.OGDEN, poisson=0.4)
    np.testing.assert_allclose(scene.materials["rubber"].stress_at(STRAIN), given.stress_at(STRAIN), rtol=1e-9)
    assert scene.materials["rubber"].density == 1190.0
    assert (out / "tensile.png").stat().st_size > 10_000


def test_the_command_refuses_and_writes_nothing(tmp_path: Path, capsys: Any) -> None:
    """Unstable terms and a missing file give exit status 2 and no directory."""
    curve = _write(tmp_path / "c.csv", STRAIN, preset("cheetah", law=Law.OGDEN, poisson=0.4).stress_at(STRAIN))
    out = tmp_path / "out"
    given = ["fit", "--law", "ogden", "--terms", "3", "--out", str(out)]
    assert main([*given, "--tensile", str(curve)]) == 2
    assert "is refused" in capsys.readouterr().err
    assert main([*given, "--tensile", str(tmp_path / "none.csv")]) == 2
    assert not out.exists()

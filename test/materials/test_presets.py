# SPDX-License-Identifier: Apache-2.0
"""The paper's filaments as printed (Table 1 and Sec. 5), and silicones as measured."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.errors import SceneError
from gdfe_ros.materials import LIBRARY, Curve, Law, Ogden, preset
from gdfe_ros.scene import load_scene
from gdfe_ros.scene.solvable import remarks


def test_table_one() -> None:
    """Ogden's constants are those of Table 1, in Pa."""
    ninjaflex = preset("ninjaflex", law=Law.OGDEN, poisson=0.495)
    assert isinstance(ninjaflex, Ogden)
    np.testing.assert_allclose(ninjaflex.mu, (0.187297e6, 0.091893e6, 3.397167e6))
    assert ninjaflex.alpha == (1.940480, 4.009788, -1.512803)
    cheetah = preset("cheetah", law=Law.OGDEN, poisson=0.495)
    np.testing.assert_allclose(cheetah.mu, (-5.497378e6, 2.499418e6, 12.259373e6))
    assert cheetah.alpha == (3.303409, 3.722506, -4.762911)


@pytest.mark.parametrize(
    ("name", "at_half", "at_one", "at_two"),
    [
        # MPa, the printed polynomials summed term by term
        ("ninjaflex", 1.90140625, 2.48, 4.78),
        ("cheetah", 4.96671875, 6.12, 8.66),
    ],
)
def test_polynomials_of_section_five(name: str, at_half: float, at_one: float, at_two: float) -> None:
    """The stresses are those of the printed polynomials, in Pa."""
    material = preset(name, law=Law.CURVE, poisson=0.495)
    assert isinstance(material, Curve)
    stress = material.stress_at(np.array([0.5, 1.0, 2.0]))
    np.testing.assert_allclose(stress, 1e6 * np.array([at_half, at_one, at_two]), rtol=1e-12)
    assert material.data.strain_max == 2.0


def test_options_reach_the_material() -> None:
    """A preset takes a density and a shape factor."""
    material = preset("cheetah", law=Law.CURVE, poisson=0.4, density=1200.0, omega=0.9)
    assert (material.poisson, material.density, material.omega) == (0.4, 1200.0, 0.9)


@pytest.mark.parametrize(("name", "law"), [("rubber", Law.OGDEN), ("cheetah", Law.LINEAR)])
def test_unknown_presets_are_refused(name: str, law: Law) -> None:
    """An unknown preset or law is refused, and the message lists the known ones."""
    with pytest.raises(ValueError, match=r"presets: ninjaflex, cheetah, ecoflex_00_30, .*; laws: ogden, curve"):
        preset(name, law=law, poisson=0.4)


SKIN = {"material": "skin"}
SILICONES = [name for name, recipe in LIBRARY.items() if recipe.misfit is not None]


def test_the_library_has_the_common_silicones() -> None:
    """All common silicones are presets, each with its source."""
    wanted = {"ecoflex_00_30", "ecoflex_00_50", "dragon_skin_10", "dragon_skin_20", "dragon_skin_30", "mold_star_16"}
    assert wanted == set(SILICONES)
    assert all("Marechal" in LIBRARY[name].source for name in wanted)


@pytest.mark.parametrize("name", SILICONES)
def test_a_curve_goes_through_its_points(name: str) -> None:
    """The curve law goes through each measured point, and Ogden's law misses them by the stated misfit."""
    data = LIBRARY[name].curve
    strain, stress = np.array(data.strain[1:]), np.array(data.stress[1:])
    np.testing.assert_allclose(preset(name, law=Law.CURVE).stress_at(strain), stress, rtol=1e-12)
    missed = np.abs(preset(name, law=Law.OGDEN).stress_at(strain) / stress - 1.0)
    assert missed.max() <= LIBRARY[name].misfit


def test_a_scene_takes_a_silicone_by_its_name() -> None:
    """A preset's name alone gives Poisson's ratio, the density if measured, and a remark on its source."""
    scene = load_scene("bend5", overrides={"materials": {"skin": {"preset": "dragon_skin_10"}}, "regions": [SKIN]})
    material = scene.materials["skin"]
    assert (material.poisson, material.density) == (0.499, 1070.0)
    assert [text for text in remarks(scene, scene.solver.policy) if "moduli are too low" in text]


def test_a_scale_makes_a_preset_stiffer() -> None:
    """A scale of two doubles every stress of both laws, and the remark on the source is left out."""
    for law in (Law.OGDEN, Law.CURVE):
        once, twice = preset("ecoflex_00_30", law=law), preset("ecoflex_00_30", law=law, scale=2.0)
        strain = np.linspace(0.0, 6.0, 13)
        np.testing.assert_allclose(twice.stress_at(strain), 2.0 * once.stress_at(strain), rtol=1e-12)
        assert (bool(once.caveat), twice.caveat) == (True, "")


def test_a_filament_needs_a_ratio() -> None:
    """A filament without Poisson's ratio, which the paper does not give, is refused with the key."""
    with pytest.raises(ValueError, match="give `poisson`"):
        preset("ninjaflex", law=Law.OGDEN)
    with pytest.raises(SceneError, match=r"materials.cheetah.*give `poisson`"):
        load_scene("twist90", overrides={"materials.cheetah": {"preset": "cheetah"}})

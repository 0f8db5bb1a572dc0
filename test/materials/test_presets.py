# SPDX-License-Identifier: Apache-2.0
"""The paper's filaments, as printed (Table 1 and Sec. 5)."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.materials import Curve, Law, Ogden, preset


def test_table_one() -> None:
    """Compare Ogden's constants with Table 1, in Pa."""
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
    """Compare stresses with the printed polynomials, in Pa."""
    material = preset(name, law=Law.CURVE, poisson=0.495)
    assert isinstance(material, Curve)
    stress = material.stress_at(np.array([0.5, 1.0, 2.0]))
    np.testing.assert_allclose(stress, 1e6 * np.array([at_half, at_one, at_two]), rtol=1e-12)
    assert material.data.strain_max == 2.0


def test_options_reach_the_material() -> None:
    """Give density and shape factor: the material has them."""
    material = preset("cheetah", law=Law.CURVE, poisson=0.4, density=1200.0, omega=0.9)
    assert (material.poisson, material.density, material.omega) == (0.4, 1200.0, 0.9)


@pytest.mark.parametrize(("name", "law"), [("rubber", Law.OGDEN), ("cheetah", Law.LINEAR)])
def test_unknown_presets_are_refused(name: str, law: Law) -> None:
    """Name the presets and the laws that there are."""
    with pytest.raises(ValueError, match=r"presets: ninjaflex, cheetah; laws: ogden, curve"):
        preset(name, law=law, poisson=0.4)

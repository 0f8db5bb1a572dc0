# SPDX-License-Identifier: Apache-2.0
"""Library of materials by name: the paper's two printed filaments, and common silicones."""

from __future__ import annotations

from gdfe_ros.materials.curve_data import CurveData
from gdfe_ros.materials.material import Curve, Law, Material, Ogden
from gdfe_ros.materials.recipe import Recipe
from gdfe_ros.materials.silicones import SILICONES

_MEGA = 1e6
_PAPER = "the paper's Table 1 (ogden) and Sec. 5 (curve)"
_FILAMENTS = {
    "ninjaflex": Recipe(
        mu=(0.187297 * _MEGA, 0.091893 * _MEGA, 3.397167 * _MEGA),
        alpha=(1.940480, 4.009788, -1.512803),
        curve=CurveData.polynomial(
            [8.67 * _MEGA, -15.7 * _MEGA, 15.02 * _MEGA, -6.91 * _MEGA, 1.53 * _MEGA, -0.13 * _MEGA], strain_max=2.0
        ),
        source=_PAPER,
    ),
    "cheetah": Recipe(
        mu=(-5.497378 * _MEGA, 2.499418 * _MEGA, 12.259373 * _MEGA),
        alpha=(3.303409, 3.722506, -4.762911),
        curve=CurveData.polynomial(
            [19.13 * _MEGA, -26.6 * _MEGA, 19.9 * _MEGA, -7.69 * _MEGA, 1.49 * _MEGA, -0.11 * _MEGA], strain_max=2.0
        ),
        source=_PAPER,
    ),
}
LIBRARY = {**_FILAMENTS, **SILICONES}
"""Dict from the name of each preset to its recipe."""
PRESETS = tuple(LIBRARY)


def preset(
    name: str,
    *,
    law: Law,
    poisson: float | None = None,
    density: float | None = None,
    omega: float | None = None,
    scale: float = 1.0,
) -> Material:
    """Return a material of the library.

    Args:
        name: one of ``PRESETS``.
        law: ``Law.OGDEN``, or ``Law.CURVE`` for the measured curve.
        poisson: initial Poisson's ratio; None for the preset's ratio. Presets of filaments have no ratio.
        density: mass density [kg/m^3]; None for the preset's density, if it has one.
        omega: shape factor for the ``relative`` policy; None for the law's own factor.
        scale: factor on every stress, for a batch that is stiffer or softer than the measured batch.

    Raises:
        ValueError: the name or the law is unknown, or neither the preset nor the argument gives Poisson's ratio.
    """
    if name not in PRESETS or law not in (Law.OGDEN, Law.CURVE):
        raise ValueError(f"no preset {name!r} with law {law!r}; presets: {', '.join(PRESETS)}; laws: ogden, curve")
    recipe = LIBRARY[name]
    if poisson is None and recipe.poisson is None:
        raise ValueError(f"preset {name!r} has no Poisson's ratio of its own; give `poisson`, rubber is near 0.495")
    common = {
        "poisson": recipe.poisson if poisson is None else poisson,
        "density": recipe.density if density is None else density,
        "omega": omega,
        "caveat": recipe.caveat if scale == 1.0 else "",
    }
    if law is Law.OGDEN:
        return Ogden(mu=tuple(scale * value for value in recipe.mu), alpha=recipe.alpha, **common)
    return Curve(data=recipe.curve.scaled(scale), **common)

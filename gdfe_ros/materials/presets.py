# SPDX-License-Identifier: Apache-2.0
"""Library of materials by name: the paper's two printed filaments, and common silicones."""

from __future__ import annotations

from dataclasses import dataclass

from gdfe_ros.materials.curve_data import CurveData
from gdfe_ros.materials.material import Curve, Law, Material, Ogden


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """A material's constants and their source.

    Attributes:
        mu: moduli of Ogden's law [Pa].
        alpha: exponents of Ogden's law.
        curve: nominal stress as a function of engineering strain, up to the largest measured strain.
        source: authors and method of the measurement.
        poisson: initial Poisson's ratio; None if the source does not give it.
        density: mass density [kg/m^3]; None if the source does not give it.
        misfit: largest relative deviation of Ogden's law from the data; None if unknown.
        caveat: limitation that a user must know; empty if there is none.
    """

    mu: tuple[float, ...]
    alpha: tuple[float, ...]
    curve: CurveData
    source: str
    poisson: float | None = None
    density: float | None = None
    misfit: float | None = None
    caveat: str = ""


_SOURCE = "Marechal et al. 2020, Soft Robotics Materials Database (ODbL); ASTM D412, crosshead strain"
_CAVEAT = (
    "its tensile test measured the crosshead's strain, so that moduli are too low: Dragon Skin 10 has 129 kPa there, "
    "235 to 264 kPa in a beam; remedy: scale: 1.9 for that batch, or fit the scale to your own robot with `gdfe fit`"
)
_KILO = 1e3
_STRAIN = (0.1, 0.25, 0.5, 1.0, 2.0, 3.0, 5.0)
_POISSON = 0.499
"""Poisson's ratio that Dubied et al. 2022 fitted to a beam of Dragon Skin 10; silicones are nearly incompressible."""


def _silicone(
    kilopascals: tuple[float, ...], *, mu: float, alpha: float, misfit: float, density: float | None = None
) -> Recipe:
    strain, stress = _STRAIN[: len(kilopascals)], (_KILO * value for value in kilopascals)
    return Recipe(
        mu=(mu,),
        alpha=(alpha,),
        curve=CurveData((), (0.0, *strain), (0.0, *stress), strain[-1]),
        source=_SOURCE,
        poisson=_POISSON,
        density=density,
        misfit=misfit,
        caveat=_CAVEAT,
    )


SILICONES = {
    "ecoflex_00_30": _silicone((3.6, 8.6, 16.9, 29.7, 52.4, 80.2, 157.0), mu=13708.0, alpha=2.4575, misfit=0.0755),
    "ecoflex_00_50": _silicone((4.9, 12.3, 22.8, 41.0, 79.0, 126.0, 251.0), mu=18659.0, alpha=2.5820, misfit=0.0587),
    "dragon_skin_10": _silicone(  # density: Dubied et al. 2022
        (11.1, 26.4, 53.0, 113.0, 273.0, 445.0, 825.0), mu=42327.0, alpha=2.9264, misfit=0.1276, density=1070.0
    ),
    "dragon_skin_20": _silicone((26.1, 72.1, 151.0, 318.0, 722.0, 1195.0), mu=105796.0, alpha=3.1221, misfit=0.1447),
    "dragon_skin_30": _silicone(
        (45.7, 111.0, 214.0, 437.0, 960.0, 1530.0, 2790.0), mu=175729.0, alpha=2.7673, misfit=0.0876
    ),
    "mold_star_16": _silicone((20.1, 51.4, 94.7, 186.0, 433.0, 763.0), mu=74708.0, alpha=2.9628, misfit=0.0446),
}
"""Dict from the name of each silicone to its recipe. Only Dragon Skin 10 has a density; give the densities of the
others in the scene.
"""


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
    return Curve(data=recipe.curve.scale_stress(scale), **common)

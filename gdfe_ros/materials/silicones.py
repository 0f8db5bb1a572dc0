# SPDX-License-Identifier: Apache-2.0
"""Common silicones, from tensile tests of the Soft Robotics Materials Database (Marechal et al. 2020, ODbL).

The tests follow ASTM D412. They measure strain at the machine's crosshead. The specimen slips and yields in its grips,
so that the measured moduli are too low. A vibrating beam of Dragon Skin 10 has a modulus of 235 to 264 kPa (Dubied et
al. 2022); the tensile test gives 129 kPa. Use only the shape of a curve, and fit its scale to your own robot (`gdfe fit
--vary materials.skin.scale=...`).

Ogden's constants are the best fit of one term to the points of the curve, each weighted by its stress
(`gdfe_ros.fitting.tensile.fit_tensile`). A test repeats the fit.
"""

from __future__ import annotations

from gdfe_ros.materials.curve_data import CurveData
from gdfe_ros.materials.recipe import Recipe

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
"""Dict from the name of each silicone to its recipe. Only Dragon Skin 10 has a density; give others in the scene."""

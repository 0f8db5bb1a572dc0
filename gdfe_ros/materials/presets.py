# SPDX-License-Identifier: Apache-2.0
"""The two printed filaments of the paper, each with its Ogden constants and its polynomial (Sec. 5, Table 1)."""

from __future__ import annotations

from gdfe_ros.materials.curve_data import CurveData
from gdfe_ros.materials.material import Curve, Law, Material, Ogden

_MEGA = 1e6
_MEASURED_TO = 2.0
_OGDEN = {
    "ninjaflex": ((0.187297, 0.091893, 3.397167), (1.940480, 4.009788, -1.512803)),
    "cheetah": ((-5.497378, 2.499418, 12.259373), (3.303409, 3.722506, -4.762911)),
}
_POLYNOMIAL = {
    "ninjaflex": (8.67, -15.7, 15.02, -6.91, 1.53, -0.13),
    "cheetah": (19.13, -26.6, 19.9, -7.69, 1.49, -0.11),
}
PRESETS = tuple(_OGDEN)


def preset(
    name: str, *, law: Law, poisson: float, density: float | None = None, omega: float | None = None
) -> Material:
    """Return a material of the paper.

    Args:
        name: ``ninjaflex`` or ``cheetah``.
        law: ``Law.OGDEN`` (Table 1) or ``Law.CURVE`` (the polynomials of Sec. 5, measured to a strain of about 2).
        poisson: Poisson's ratio at rest.
        density: mass density [kg/m^3].
        omega: a given shape factor for the ``relative`` policy.

    Raises:
        ValueError: the name or the law is not one of these.
    """
    if name not in PRESETS or law not in (Law.OGDEN, Law.CURVE):
        raise ValueError(f"no preset {name!r} with law {law!r}; presets: {', '.join(PRESETS)}; laws: ogden, curve")
    common = {"poisson": poisson, "density": density, "omega": omega}
    if law is Law.OGDEN:
        mu, alpha = _OGDEN[name]
        return Ogden(mu=tuple(value * _MEGA for value in mu), alpha=alpha, **common)
    coefficients = tuple(value * _MEGA for value in _POLYNOMIAL[name])
    return Curve(data=CurveData.polynomial(coefficients, strain_max=_MEASURED_TO), **common)

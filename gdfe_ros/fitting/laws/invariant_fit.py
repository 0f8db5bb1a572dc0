# SPDX-License-Identifier: Apache-2.0
"""Fits of the laws of Yeoh, Mooney and Rivlin, Arruda and Boyce, and Gent to a uniaxial test."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar, nnls

from gdfe_ros.materials import ArrudaBoyce, Gent, Law, Material, MooneyRivlin, Yeoh

Vector = NDArray[np.float64]
Found = tuple[Material, dict[str, Any]]
INVARIANT_LAWS = (Law.YEOH, Law.MOONEY_RIVLIN, Law.ARRUDA_BOYCE, Law.GENT)
"""Laws that `invariant_candidates` fits."""
LOCKING = (1.05, 60.0)
"""Range of the locking stretch of Arruda and Boyce."""
LIMITS = (1.01, 1e4)
"""Range of Gent's parameter J_m, divided by the largest I1 - 3 of the test."""


def invariant_candidates(
    strain: Vector, stress: Vector, weights: Vector, law: Law, common: Mapping[str, Any]
) -> Iterator[Found]:
    """Yield laws that fit a test, the best first; the last one has no negative coefficients, and is stable.

    Minimises sum_k (w_k (sigma(e_k) - sigma_k))^2, where sigma(e) is the nominal stress of uniaxial tension at constant
    volume. Laws without a positive initial modulus are left out.

    Args:
        strain: engineering strains (k,).
        stress: nominal stresses (k,) [Pa].
        weights: factors w_k (k,) [1/Pa].
        law: one of `INVARIANT_LAWS`.
        common: parameters that all laws have.
    """
    stretch = 1.0 + strain
    x = stretch**2 + 2.0 / stretch - 3.0
    if law in (Law.YEOH, Law.MOONEY_RIVLIN):
        if law is Law.YEOH:
            parts, names, kind = [np.ones_like(x), 2.0 * x, 3.0 * x**2], ("c10", "c20", "c30"), Yeoh
        else:
            parts, names, kind = [np.ones_like(x), 1.0 / stretch], ("c10", "c01"), MooneyRivlin
        columns = 2.0 * (stretch - stretch**-2.0)[:, None] * np.stack(parts, axis=1)
        weighted, target = columns * weights[:, None], stress * weights
        scale = np.linalg.norm(weighted, axis=0)
        for values in (np.linalg.lstsq(weighted / scale, target, rcond=None)[0], nnls(weighted / scale, target)[0]):
            entry = dict(zip(names, (values / scale).tolist(), strict=True))
            if entry["c10"] + entry.get("c01", 0.0) > 0.0:
                yield kind(**entry, **common), entry
        return
    if law is Law.GENT:
        kind, name, bounds = Gent, "jm", np.log(np.array(LIMITS) * x.max())
    else:
        kind, name, bounds = ArrudaBoyce, "lambda_m", np.log(LOCKING)

    def modulus(value: float) -> tuple[float, float]:
        """Return the best modulus [Pa] for a value of the other parameter, and its sum of squared errors."""
        unit = kind(mu=1.0, **{name: value}, **common).stress_at(strain) * weights
        mu = float(unit @ (stress * weights) / (unit @ unit))
        return mu, float(np.sum((mu * unit - stress * weights) ** 2))

    options = {"bounds": bounds, "method": "bounded", "options": {"xatol": 1e-10}}
    best = minimize_scalar(lambda log: modulus(np.exp(log))[1], **options)
    value = float(np.exp(best.x))
    entry = {"mu": modulus(value)[0], name: value}
    if entry["mu"] > 0.0:
        yield kind(**entry, **common), entry

# SPDX-License-Identifier: Apache-2.0
"""A stress-strain law from a uniaxial tensile test."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.laws.invariant_fit import INVARIANT_LAWS, Found, invariant_candidates
from gdfe_ros.fitting.laws.tensile_data import TestData, Vector, prepare
from gdfe_ros.materials import Curve, CurveData, Law, Linear, Material, NeoHookean, Ogden, StableNeoHookean

FLOOR = 0.01
"""Errors are divided by at least this fraction of the largest stress, because small stresses are mostly noise."""
SURE = 4.0
"""Errors are divided by at least SURE / GOOD times the scatter of the stresses, so that noisy points have little
weight. If this limit exceeds all stresses, the fit minimises absolute errors.
"""
GOOD = 0.01
"""A fit is good enough, and no further terms are tried, if the relative misfit at every point is below this."""
MOST_TERMS = 3
MOST_ALPHA = 20.0
"""Largest magnitude of Ogden's exponents; for larger ones, powers of the stretch overflow."""
FAINT = 1e-6
"""Least magnitude of an exponent; a term with the exponent 0 would have no stress."""
STARTS = (-6.0, -3.0, -1.5, 1.0, 2.0, 3.0, 5.0)
"""Initial exponents of the search, used in all combinations."""
CANCELLED = 100.0
"""Ratio of the sum of |mu_i| to the sum of mu_i above which terms count as cancelling each other. For the materials of
the paper, the ratio is at most 2.2.
"""
DEGREE = 6
"""Default degree of a polynomial, as in the paper."""
SOFTEST, HARDEST = 1e3, 1e12
"""Plausible range of initial moduli [Pa]: gels have a few kilopascals, diamond has 1e12 Pa. Outside this range, a unit
is probably wrong.
"""
LARGEST_STRAIN = 15.0
"""Engineering strains above this are probably percentages: no rubber is stretched sixteenfold."""


@dataclass(frozen=True, kw_only=True)
class TensileFit:
    """A law, and its agreement with the test.

    Attributes:
        material: the law; its Poisson's ratio was given, because a tensile test does not determine it.
        entry: the law as an entry for the key `materials` of a scene.
        strain: engineering strains of the test (k,), without zeros.
        stress: nominal stresses of the test (k,) [Pa].
        misfit: relative misfit of each point (k,): the error of its stress, divided by the largest of three stresses:
            the measured stress of the point, ``FLOOR`` times the largest stress, and ``SURE / GOOD`` times the scatter.
        remarks: instabilities of the law; empty for an accepted law.
        refused: messages about unstable laws of the same kind that were tried.
        notes: messages about points that were left out, and about slack.
    """

    material: Material
    entry: Mapping[str, Any]
    strain: Vector
    stress: Vector
    misfit: Vector
    remarks: tuple[str, ...]
    refused: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def largest(self) -> float:
        """Largest magnitude of a point's misfit."""
        return float(np.abs(self.misfit).max())


def fit_tensile(
    strain: ArrayLike,
    stress: ArrayLike,
    *,
    law: Law,
    terms: int | None = None,
    degree: int = DEGREE,
    poisson: float = 0.499,
    density: float | None = None,
    slack: float | None = None,
) -> TensileFit:
    """Fit a law to a tensile test by least squares of the relative misfit.

    Minimises sum_k ((sigma(e_k) - sigma_k) / max(|sigma_k|, FLOOR max|sigma|, SURE/GOOD d))^2, where sigma(e) is the
    law's nominal stress in incompressible uniaxial tension, and d the scatter of the stresses about a smooth curve.
    Unloading, outliers and slack of the grips are left out (`tensile_data.prepare`).

    Args:
        strain: engineering strains (k,); compression is negative.
        stress: nominal stresses (k,) [Pa].
        law: the law; ``CURVE`` is a polynomial.
        terms: number of terms of Ogden's law. None means the least number for which a stable law has a misfit below
            ``GOOD`` at every point, or the number of the best stable law if there is no such law.
        degree: degree of the polynomial.
        poisson: initial Poisson's ratio, for the scene.
        density: mass density [kg/m^3], for the scene.
        slack: strain at which the specimen becomes taut; None to find it in the data.

    Raises:
        GdfeError: the columns are not a tensile test, a unit is implausible, or the law that fits best is unstable.

    Example:
        >>> fit_tensile([0.1, 0.5, 1.0], [11.1e3, 53.0e3, 113.0e3], law=Law.NEO_HOOKEAN).material.young > 1e5
        True
    """
    data = prepare(*_check(strain, stress), slack=slack)
    e, s, weights = data.strain, data.stress, _weights(data)
    if e.size < 2:
        raise GdfeError(f"{e.size} points are left of {np.size(strain)}; remedy: a smaller --slack")
    common = {"poisson": poisson, "density": density}
    if law is Law.OGDEN:
        fit = _ogden(e, s, weights, terms, common)
    elif law in INVARIANT_LAWS:
        fit = _invariant(e, s, weights, law, common)
    else:
        fit = _assess(e, s, weights, _linear_in_parameters(e, s, weights, law, degree, common))
    limits = [text for text in fit.material.remarks() if text not in fit.remarks]
    fit = replace(fit, notes=(*data.remarks, *limits))
    if fit.remarks:
        other = "--terms 1" if law is Law.OGDEN else "a smaller --degree, or --law ogden"
        raise GdfeError(f"{_refusal(fit)}; remedy: {other}")
    if not SOFTEST < fit.material.young0 < HARDEST:
        raise GdfeError(
            f"the initial modulus is {fit.material.young0:.4g} Pa; expected is {SOFTEST:g} to {HARDEST:g} Pa; remedy: "
            f"{'; '.join(['give stress in Pa (1 kPa is 1000) and strain without percent', *data.remarks])}"
        )
    return fit


def _check(strain: ArrayLike, stress: ArrayLike) -> tuple[Vector, Vector]:
    """Return strains and stresses of the points with nonzero strain; raise GdfeError if they are no tensile test."""
    e, s = np.asarray(strain, dtype=np.float64), np.asarray(stress, dtype=np.float64)
    if e.ndim != 1 or e.shape != s.shape or not (np.isfinite(e).all() and np.isfinite(s).all()):
        raise GdfeError(f"strain and stress must be finite columns of equal length, got {e.shape} and {s.shape}")
    if e.size and (e.min() <= -1.0 or e.max() > LARGEST_STRAIN):
        raise GdfeError(
            f"strains from {e.min():g} to {e.max():g}; allowed: above -1, to {LARGEST_STRAIN:g}; remedy: 100 % is 1.0"
        )
    moved = e != 0.0
    if moved.sum() < 2 or np.ptp(s[moved]) == 0.0:
        raise GdfeError("the data do not move: at least two strains other than 0, with different stresses, are needed")
    return e[moved], s[moved]


def _weights(data: TestData) -> Vector:
    """Return the factors (k,) [1/Pa] that convert errors of stresses to misfits."""
    least = max(FLOOR * np.abs(data.stress).max(initial=0.0), SURE / GOOD * data.scatter)
    return 1.0 / np.maximum(np.abs(data.stress), least)


def _linear_in_parameters(
    e: Vector, s: Vector, weights: Vector, law: Law, degree: int, common: Mapping[str, Any]
) -> Found:
    """Fit a law whose stress is linear in its parameters, by linear least squares; return the law and its entry."""
    kinds = {Law.LINEAR: Linear, Law.NEO_HOOKEAN: NeoHookean, Law.STABLE_NEO_HOOKEAN: StableNeoHookean}
    if law is Law.CURVE:
        if not 1 <= degree <= e.size:
            raise GdfeError(f"a polynomial of degree {degree} through {e.size} points; allowed: 1 to {e.size}")
        columns = e[:, None] ** np.arange(1, degree + 1)
        coefficients = np.linalg.lstsq(columns * weights[:, None], s * weights, rcond=None)[0]
        end = float(e.max())
        if coefficients[0] <= 0.0:
            text = f"the polynomial of degree {degree} starts with the slope {coefficients[0]:.4g} Pa"
            raise GdfeError(f"{text}, which is unstable; remedy: a smaller --degree, or law: ogden")
        curve = CurveData.polynomial(coefficients, strain_max=end)
        return Curve(data=curve, **common), {"coefficients": coefficients.tolist(), "strain_max": end}
    unit = kinds[law](young=1.0, poisson=0.5).stress_at(e) * weights
    young = float(unit @ (s * weights) / (unit @ unit))
    if young <= 0.0:
        raise GdfeError(
            f"the best modulus is {young:.4g} Pa, which is unstable; remedy: check the signs of the columns"
        )
    return kinds[law](young=young, **common), {"young": young}


def _invariant(e: Vector, s: Vector, weights: Vector, law: Law, common: Mapping[str, Any]) -> TensileFit:
    """Fit a law of the invariants; if the best fit is unstable, use the best fit without negative coefficients."""
    refused = []
    for found in invariant_candidates(e, s, weights, law, common):
        fit = _assess(e, s, weights, found)
        if not fit.remarks:
            return replace(fit, refused=tuple(refused))
        refused.append(_refusal(fit))
    name = law.name.lower()
    why = "; ".join(refused) or f"the best {name} law has a negative modulus"
    raise GdfeError(f"no stable law {name}: {why}; remedy: check the signs of the columns, or --law ogden")


def _ogden(e: Vector, s: Vector, weights: Vector, terms: int | None, common: Mapping[str, Any]) -> TensileFit:
    """Fit Ogden's law with ``terms`` terms.

    None means the least number for which a stable law has a misfit below `GOOD` at every point, or the number of the
    best stable law if there is no such law. One term is stable for every test with a positive work.
    """
    most = min(MOST_TERMS, e.size // 2)
    if terms is not None:
        if not 1 <= terms <= most:
            raise GdfeError(f"{terms} terms of Ogden's law for {e.size} points; allowed: 1 to {most}")
        return _assess(e, s, weights, _ogden_terms(e, s, weights, terms, common))
    stable, refused = [], []
    for count in range(1, most + 1):
        try:
            fit = _assess(e, s, weights, _ogden_terms(e, s, weights, count, common))
        except GdfeError as error:
            refused.append(str(error).partition("; remedy")[0])
            continue
        if fit.remarks:
            refused.append(_refusal(fit))
            continue
        stable.append(fit)
        if fit.largest < GOOD:
            break
    if not stable:
        raise GdfeError(f"no stable law of Ogden: {'; '.join(refused)}; remedy: check the signs of the columns")
    return replace(min(stable, key=lambda item: item.largest), refused=tuple(refused))


def _ogden_terms(e: Vector, s: Vector, weights: Vector, count: int, common: Mapping[str, Any]) -> Found:
    """Fit exponents by a trust-region method; linear least squares give the moduli for each trial of the exponents."""

    def moduli(alpha: Vector) -> tuple[Vector, Vector]:
        alpha = np.where(np.abs(alpha) < FAINT, FAINT, alpha)
        stretch, half = 1.0 + e[:, None], -0.5 * alpha
        columns = 2.0 / alpha * (stretch ** (alpha - 1.0) - stretch ** (half - 1.0)) * weights[:, None]
        mu = np.linalg.lstsq(columns, s * weights, rcond=None)[0]
        return mu, columns @ mu - s * weights

    found = []
    for start in combinations(STARTS, count):
        given = {"bounds": (-MOST_ALPHA, MOST_ALPHA), "xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15, "max_nfev": 400}
        found.append(least_squares(lambda alpha: moduli(alpha)[1], start, x_scale="jac", **given))
    alpha = np.sort(min(found, key=lambda result: result.cost).x)
    entry = {"mu": moduli(alpha)[0].tolist(), "alpha": alpha.tolist()}
    if not 0.0 < sum(entry["mu"]) < HARDEST:
        total = f"moduli that sum to {sum(entry['mu']):.4g} Pa"
        raise GdfeError(
            f"ogden with {count} terms: {total} are unstable without deformation; remedy: fewer --terms, or law: curve"
        )
    return Ogden(mu=tuple(entry["mu"]), alpha=tuple(entry["alpha"]), **common), entry


def _assess(e: Vector, s: Vector, weights: Vector, found: Found) -> TensileFit:
    """Return the fit of a law: its misfit at each point, and remarks on its stability."""
    material, parameters = found
    entry = {"law": material.law.name.lower(), **parameters, "poisson": material.poisson}
    entry |= {"density": material.density} if material.density is not None else {}
    misfit = (material.stress_at(e) - s) * weights
    remarks = material.data.remarks() if isinstance(material, Curve) else material.remarks()
    if isinstance(material, Ogden) and sum(map(abs, material.mu)) > CANCELLED * sum(material.mu):
        remarks = ["its terms cancel each other, because the data determine fewer of them", *remarks]
    return TensileFit(material=material, entry=entry, strain=e, stress=s, misfit=misfit, remarks=tuple(remarks))


def _refusal(fit: TensileFit) -> str:
    """Return a message about an unstable law: its kind, its misfit, and its instabilities."""
    name = fit.entry["law"]
    if isinstance(fit.material, Ogden):
        count = len(fit.material.mu)
        name = f"{name} with {count} term{'s' if count > 1 else ''}"
    causes = "; ".join(note.partition("; remedy")[0] for note in fit.remarks)
    return f"{name}, which misses the points by up to {100.0 * fit.largest:.2g} %, is refused: {causes}"


_PLAIN = ("linear", "neo_hookean", "stable_neo_hookean", "curve")
"""Laws that count as stable without a check in several modes of deformation."""
ACCEPTABLE = 0.05
"""Relative misfit above which another law is recommended; repeated tests of one batch differ by about this much."""


def tensile_rows(fit: TensileFit) -> list[tuple[str, str]]:
    """Return the results as pairs of name and text."""
    parameters = {key: value for key, value in fit.entry.items() if key not in ("law", "poisson", "density")}
    rows = [("law", str(fit.entry["law"]))]
    for name, value in parameters.items():
        values = value if isinstance(value, list) else [value]
        rows.append((name, "  ".join(f"{number:.7g}" for number in values)))
    return [
        *rows,
        ("initial modulus [Pa]", f"{fit.material.young0:.5g}"),
        ("misfit, root mean square", f"{100.0 * float(np.sqrt(np.mean(fit.misfit**2))):.3g} % of the stress"),
        ("misfit, largest", f"{100.0 * fit.largest:.3g} % at strain {fit.strain[np.abs(fit.misfit).argmax()]:g}"),
        ("valid", f"strain {min(0.0, fit.strain.min()):g} to {max(0.0, fit.strain.max()):g}, of tension alone"),
        (
            "stability",
            "stable" if fit.entry["law"] in _PLAIN else "stable in uniaxial, equibiaxial and planar deformation",
        ),
    ]


def tensile_remarks(fit: TensileFit) -> list[str]:
    """Return remarks on points left out, on refused laws and on a large misfit; empty if there are none."""
    notes = [*fit.notes, *fit.refused]
    if fit.largest > ACCEPTABLE:
        text = f"no stable law of this kind has a largest misfit below {100.0 * fit.largest:.2g} %"
        notes.append(f"{text}; remedy: law: curve with the measured table (csv), which passes through every point")
    return notes


def material_text(fit: TensileFit, name: str) -> str:
    """Return the fitted law as YAML text for the key `materials` of a scene; ``name`` becomes a name of a material."""
    name = re.sub(r"^(?![A-Za-z])", "m_", re.sub(r"[^A-Za-z0-9_]", "_", name))
    return yaml.safe_dump({name: dict(fit.entry)}, sort_keys=False, default_flow_style=None, width=110)


def draw_tensile(path: Path, fit: TensileFit, *, title: str) -> None:
    """Draw the test and the law: nominal stress over strain, and the misfit of each point.

    Raises:
        OSError: the picture cannot be written.
    """
    from matplotlib.figure import Figure  # a fit alone needs no matplotlib

    figure = Figure(figsize=(9.0, 4.2), dpi=130, layout="constrained")
    curve, misfit = figure.subplots(1, 2, width_ratios=(3, 2))
    low, high = min(0.0, float(fit.strain.min())), max(0.0, float(fit.strain.max()))
    grid = np.linspace(low, high, 400)
    curve.plot(fit.strain, 1e-3 * fit.stress, "o", ms=4, color="#6b6f76", label="measured")
    curve.plot(grid, 1e-3 * fit.material.stress_at(grid), color="#1b6ca8", label=str(fit.entry["law"]))
    curve.set_xlabel("engineering strain")
    curve.set_ylabel("nominal stress [kPa]")
    curve.legend(frameon=False)
    misfit.axhline(0.0, color="0.7", lw=0.8)
    misfit.plot(fit.strain, 100.0 * fit.misfit, "o-", ms=4, lw=0.8, color="#c2562d")
    misfit.set_xlabel("engineering strain")
    misfit.set_ylabel("misfit [% of the stress]")
    for axes in (curve, misfit):
        axes.grid(color="0.93")
    figure.suptitle(title, fontsize=11)
    figure.savefig(path)

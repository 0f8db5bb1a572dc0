# SPDX-License-Identifier: Apache-2.0
"""Preparation of a tensile test: loading only, slack of the grips removed, scatter estimated, outliers left out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

FEWEST = 12
"""With fewer points, scatter, slack and outliers are not estimated."""
BACK = 0.02
"""A point is unloading if its strain is below the largest earlier strain by more than this fraction of the range."""
OUTLIER = 8.0
"""A point is an outlier if its distance from the curve through its neighbours exceeds this multiple of the scatter."""
LEAST_SLACK, MOST_SLACK = 0.002, 0.2
"""Range of strains that are subtracted as slack; a longer flat part gets a remark."""
FLAT = 0.1
"""Largest stress of slack grips, as a fraction of the stress that the taut specimen would have."""
SPIKE = 0.01
"""Least distance of an outlier from the curve through its neighbours, as a fraction of the largest stress."""
TAUT, NEAR = (0.02, 0.3), 0.6
"""Range of stresses, divided by the largest stress at strains below `NEAR`. The curve in this range is fitted and
extrapolated to zero stress.
"""
FOOT = 6
"""Fewest points that are fitted. In a coarse table, their stresses exceed `TAUT`."""


@dataclass(frozen=True, eq=False)
class TestData:
    """Points of a test to which a law is fitted.

    Attributes:
        strain: engineering strains (k,), counted from the end of the slack.
        stress: nominal stresses (k,) [Pa].
        scatter: standard deviation [Pa] of the stresses about a smooth curve; 0 if there are too few points to tell.
        remarks: messages about points that are left out and about slack.
    """

    __test__ = False  # the name begins like that of a test

    strain: Vector
    stress: Vector
    scatter: float
    remarks: tuple[str, ...] = ()


def prepare(strain: Vector, stress: Vector, *, slack: float | None = None) -> TestData:
    """Return the points of a test that belong to the first loading of the taut specimen.

    Args:
        strain: engineering strains (k,) in the order of the test.
        stress: nominal stresses (k,) [Pa].
        slack: strain at which the specimen becomes taut; None to find it.
    """
    notes: list[str] = []
    kept = _loading(strain)
    if (away := len(strain) - int(kept.sum())) and len(strain) >= FEWEST:
        strain, stress = strain[kept], stress[kept]
        notes.append(
            f"{away} points of unloading or of later cycles are left out; remedy to fit them: a file of their own"
        )
    scatter, outlying = _scatter(strain, stress)
    foot = _foot(strain[~outlying], stress[~outlying], scatter) if slack is None else None
    found = slack or 0.0 if foot is None else _slack(strain, stress, scatter, foot)
    if found > 0.0:
        taut = strain > found
        text = f"slack: the specimen is taut from strain {found:.4g} on, which is subtracted"
        notes.append(f"{text}; {int((~taut).sum())} points before it are left out (`--slack 0` keeps them)")
        strain, stress = strain[taut] - found, stress[taut]
    elif foot is not None and (bad := _below_foot(strain, stress, scatter, foot)).any():
        text = f"{int(bad.sum())} points at the foot have hardly any stress where their neighbours have"
        notes.append(f"{text}; they are left out (`--slack 0` keeps them)")
        strain, stress = strain[~bad], stress[~bad]
    elif slack is None and (end := _flat_part(strain, stress, scatter)):
        text = f"the curve is flat up to strain {end:.3g}, which is not subtracted"
        notes.append(f"{text}; remedy if the specimen was slack: `--slack {end:.3g}`")
    scatter, outlying = _scatter(strain, stress)
    if outlying.any():
        listed = ", ".join(f"{value:.4g}" for value in strain[outlying][:5])
        notes.append(f"{int(outlying.sum())} points far from their neighbours are left out, at the strains {listed}")
        strain, stress = strain[~outlying], stress[~outlying]
    return TestData(strain, stress, scatter, tuple(notes))


def _loading(strain: Vector) -> NDArray[np.bool_]:
    """Return whether each point belongs to the first loading: it precedes the largest strain, and is no unloading."""
    side = 1.0 if abs(strain.max(initial=0.0)) >= abs(strain.min(initial=0.0)) else -1.0
    along = side * strain
    reached = np.maximum.accumulate(along) if len(along) else along
    return (np.arange(len(along)) <= int(np.argmax(along))) & (along >= reached - BACK * np.ptp(along))


def _scatter(strain: Vector, stress: Vector) -> tuple[float, NDArray[np.bool_]]:
    """Return the scatter [Pa] of the stresses, and whether each point is an outlier.

    Each point is compared with the parabola through its four neighbours, in the order of the strains.
    """
    none = np.zeros(len(strain), dtype=bool)
    if len(strain) < FEWEST:
        return 0.0, none
    order = np.argsort(strain, kind="stable")
    s = stress[order]
    differences = s[2:-2] - (4.0 * (s[1:-3] + s[3:-1]) - (s[:-4] + s[4:])) / 6.0
    scale = np.sqrt(1.0 + (2 * 16.0 + 2 * 1.0) / 36.0)
    scatter = float(np.median(np.abs(differences)) / 0.6745 / scale)
    wide = np.zeros(len(s), dtype=bool)
    far = np.abs(differences) > OUTLIER * scale * max(scatter, 1e-9 * np.abs(s).max())
    peak = np.abs(differences) >= np.maximum.reduce([np.abs(np.roll(differences, k)) for k in (-2, -1, 1, 2)])
    wide[2:-2] = far & peak & (np.abs(differences) > SPIKE * np.abs(s).max())
    none[order] = wide
    return scatter, none


class _Foot(NamedTuple):
    """Start of the taut specimen's curve: the strain as a parabola in the stress.

    Attributes:
        coefficients: strains c_k in strain = sum_k c_k (stress / high)^k for k = 0, 1, 2.
        high: upper end [Pa] of the range of stresses to which the parabola is fitted.
        error: standard deviation of the strain at zero stress.
    """

    coefficients: Vector
    high: float
    error: float

    @property
    def end(self) -> float:
        """Strain at zero stress."""
        return float(self.coefficients[0])

    @property
    def slope(self) -> float:
        """Slope d(stress)/d(strain) [Pa] at zero stress."""
        return self.high / max(float(self.coefficients[1]), 1e-12)


def _foot(strain: Vector, stress: Vector, scatter: float) -> _Foot | None:
    """Fit the start of the curve to the points with stresses in the range `TAUT`; return None if there are too few."""
    near = strain < NEAR
    if len(strain) < FEWEST or not near.any() or stress.max() <= abs(stress.min()):
        return None
    low, high = (fraction * stress[near].max() for fraction in TAUT)
    above = stress > max(low, 4.0 * scatter)
    used = np.flatnonzero(above & near & (stress < high))
    if len(used) < FOOT:
        used = np.argsort(strain, kind="stable")
        used = used[above[used]][:FOOT]
    if len(used) < FOOT:
        return None
    high = stress[used].max()
    columns = np.vander(stress[used] / high, 3, increasing=True)
    coefficients = np.linalg.lstsq(columns, strain[used], rcond=None)[0]
    misfit = strain[used] - columns @ coefficients
    variance = (misfit @ misfit) / (len(used) - 3)
    error = np.sqrt(variance * np.linalg.pinv(columns.T @ columns)[0, 0])
    return _Foot(coefficients, high, float(error))


def _slack(strain: Vector, stress: Vector, scatter: float, foot: _Foot) -> float:
    """Return the strain at which slack grips become taut, `_Foot.end`; 0 if the data show no slack."""
    end = foot.end
    before = strain <= end
    if not max(LEAST_SLACK, 4.0 * foot.error) < end <= MOST_SLACK or not before.any():
        return 0.0
    return end if _is_flat(strain[before], stress[before], scatter, foot.slope) else 0.0


def _is_flat(strain: Vector, stress: Vector, scatter: float, slope: float) -> bool:
    """Return whether points have hardly any stress (`FLAT`) compared with a curve of this slope [Pa]."""
    square = strain @ strain
    secant, error = strain @ stress / square, scatter / np.sqrt(square)
    most = max(FLAT * slope * strain.max(), 4.0 * scatter)
    return bool(np.abs(stress).max() <= most and max(secant, error) < FLAT * slope)


def _flat_part(strain: Vector, stress: Vector, scatter: float) -> float:
    """Return the strain at which a curve begins to rise after a flat part; 0 if it rises from the start."""
    order = np.argsort(strain, kind="stable")
    e, s = strain[order], stress[order]
    ahead, most = 2 + len(e) // 20, max(TAUT[0] * s.max(initial=0.0), 4.0 * scatter)
    for k in range(len(e) - 1 - ahead, -1, -1):
        if e[0] <= 0.0 or e[k] <= LEAST_SLACK or e[k + 1] == e[k + ahead] or np.abs(s[: k + 1]).max() > most:
            continue
        slope = (s[k + ahead] - s[k + 1]) / (e[k + ahead] - e[k + 1])
        if slope * e[k] > 6.0 * scatter and _is_flat(e[: k + 1], s[: k + 1], scatter, slope):
            return float(np.clip(e[k + 1] - s[k + 1] / slope, e[k], e[k + 1]))
    return 0.0


def _below_foot(strain: Vector, stress: Vector, scatter: float, foot: _Foot) -> NDArray[np.bool_]:
    """Return whether each point at the start of the curve has far less stress (`FLAT`) than the extrapolated curve."""
    expected = foot.slope * (strain - foot.end)
    early = (strain > foot.end) & (expected < foot.high) & (foot.end <= max(LEAST_SLACK, 4.0 * foot.error))
    return early & (np.abs(stress) < FLAT * expected) & (expected - stress > 8.0 * scatter)

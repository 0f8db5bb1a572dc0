# SPDX-License-Identifier: Apache-2.0
"""Preparation of a tensile test: loading only, slack of the grips removed, scatter estimated, outliers left out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

FEWEST = 12
"""Least number of points for which scatter, slack and outliers are looked for."""
BACK = 0.02
"""A strain that falls below the largest one before by this fraction of the range belongs to unloading."""
OUTLIER = 8.0
"""A point is an outlier if it is this many times the scatter away from the curve through its neighbours."""
MOST_SLACK = 0.1
"""Largest strain that counts as slack."""
FLAT = 0.2
"""Largest stress of slack grips, as a fraction of the stress that the taut specimen would have."""
SPIKE = 0.01
"""Least distance of an outlier, as a fraction of the largest stress."""
TAUT = (0.01, 0.12)
"""Range of stress, as fractions of the largest, that is extrapolated to the strain without stress."""


@dataclass(frozen=True, eq=False)
class TestData:
    """Points of a test that a law is fitted to.

    Attributes:
        strain: engineering strains (k,) from the end of the slack on.
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
    scatter, outlying = _scatter(strain, stress)
    if outlying.any():
        listed = ", ".join(f"{value:.4g}" for value in strain[outlying][:5])
        notes.append(f"{int(outlying.sum())} points far from their neighbours are left out, at the strains {listed}")
        strain, stress = strain[~outlying], stress[~outlying]
    return TestData(strain, stress, scatter, tuple(notes))


def _loading(strain: Vector) -> NDArray[np.bool_]:
    """Return which points belong to the first loading: none before it has had a larger strain."""
    side = 1.0 if abs(strain.max(initial=0.0)) >= abs(strain.min(initial=0.0)) else -1.0
    along = side * strain
    reached = np.maximum.accumulate(along) if len(along) else along
    return (np.arange(len(along)) <= int(np.argmax(along))) & (along >= reached - BACK * np.ptp(along))


def _scatter(strain: Vector, stress: Vector) -> tuple[float, NDArray[np.bool_]]:
    """Return the scatter [Pa] of the stresses, and which points are outliers.

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
    """Strain as a parabola in the stress where the specimen is taut.

    Attributes:
        coefficients: of the stress over ``high`` to the powers 0, 1, 2.
        high: largest stress [Pa] of the points that give it.
        error: standard deviation of the strain without stress.
    """

    coefficients: Vector
    high: float
    error: float

    @property
    def end(self) -> float:
        """Strain without stress."""
        return float(self.coefficients[0])

    @property
    def slope(self) -> float:
        """Slope [Pa] of the stress at the strain without stress."""
        return self.high / max(float(self.coefficients[1]), 1e-12)


def _foot(strain: Vector, stress: Vector, scatter: float) -> _Foot | None:
    """Return the curve through the points with stresses in the range `TAUT`; None if there are too few."""
    if len(strain) < FEWEST or stress.max() <= abs(stress.min()):
        return None
    low, high = (fraction * stress.max() for fraction in TAUT)
    used = (stress > max(low, 4.0 * scatter)) & (stress < high) & (strain < 3.0 * MOST_SLACK)
    if used.sum() < 5:
        return None
    columns = np.vander(stress[used] / high, 3, increasing=True)
    coefficients = np.linalg.lstsq(columns, strain[used], rcond=None)[0]
    misfit = strain[used] - columns @ coefficients
    variance = (misfit @ misfit) / max(used.sum() - 3, 1)
    error = np.sqrt(variance * np.linalg.pinv(columns.T @ columns)[0, 0])
    return _Foot(coefficients, high, float(error))


def _slack(strain: Vector, stress: Vector, scatter: float, foot: _Foot) -> float:
    """Return the strain at which slack grips become taut, that of the foot's curve without stress; 0 without slack."""
    end = foot.end
    before = strain <= end
    flat = before.any() and np.abs(stress[before]).max() <= max(FLAT * foot.slope * end, 4.0 * scatter)
    return end if flat and max(0.002, 4.0 * foot.error) < end <= MOST_SLACK else 0.0


def _below_foot(strain: Vector, stress: Vector, scatter: float, foot: _Foot) -> NDArray[np.bool_]:
    """Return which points have hardly any of the stress that the continuation of the foot's curve has there."""
    expected = foot.slope * (strain - foot.end)
    early = (strain > foot.end) & (expected < TAUT[1] * stress.max())
    return early & (np.abs(stress) < FLAT * expected) & (expected - stress > 8.0 * scatter)

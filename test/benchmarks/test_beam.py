# SPDX-License-Identifier: Apache-2.0
"""The measured beam: the evaluation of a recorded swing, and linear beam theory against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import beam

YOUNG = 3e5
STIFF = YOUNG * beam.SIDE**4 / 12.0


def test_a_swing_is_read() -> None:
    """Sag, frequency and damping ratio of a synthetic decaying swing are found."""
    times = np.arange(0.0, 2.2, 0.005)
    decay, turn = 0.05 * 2.0 * np.pi * 4.0, 2.0 * np.pi * 4.0 * np.sqrt(1.0 - 0.05**2)
    height = -10.0 * (1.0 - np.exp(-decay * times) * np.cos(turn * times))
    sag, frequency, ratio = beam.swings(times, height)
    assert sag == pytest.approx(10.0, rel=0.01)
    assert frequency == pytest.approx(4.0, rel=0.01)
    assert ratio == pytest.approx(0.05, rel=0.05)


def test_theory_is_that_of_the_books() -> None:
    """For a negligible own weight, sag is P L^3 / 3 E I plus shear, and the frequency follows from the sag."""
    mass, lever = 100.0, 0.02
    load = mass * beam.GRAVITY
    sag, slope = beam.deflection(YOUNG, mass)
    shear = load * beam.LENGTH / (beam.SHEAR_AREA * beam.SIDE**2 * YOUNG / (2.0 * (1.0 + beam.POISSON)))
    assert sag[-1] == pytest.approx(load * beam.LENGTH**3 / (3.0 * STIFF) + shear, rel=1e-3)
    assert slope[-1] == pytest.approx(load * beam.LENGTH**2 / (2.0 * STIFF), rel=1e-3)
    further, steeper = beam.deflection(YOUNG, mass, lever)
    assert further[-1] - sag[-1] == pytest.approx(load * lever * beam.LENGTH**2 / (2.0 * STIFF), rel=1e-3)
    assert steeper[-1] - slope[-1] == pytest.approx(load * lever * beam.LENGTH / STIFF, rel=1e-3)
    assert beam.first_frequency(YOUNG, mass) == pytest.approx(np.sqrt(beam.GRAVITY / sag[-1]) / (2.0 * np.pi), rel=1e-3)


def test_a_bare_beam_vibrates_as_the_books_say() -> None:
    """Without a load, shear makes the first frequency up to 7 % lower than that of a thin beam (1.875^2)."""
    thin = 1.875104**2 / (2.0 * np.pi) * np.sqrt(STIFF / (beam.DENSITY * beam.SIDE**2 * beam.LENGTH**4))
    assert 0.93 * thin < beam.first_frequency(YOUNG, 0.0) < thin


def test_recordings_ask_for_more_sag_than_one_modulus_gives() -> None:
    """With the modulus of the unloaded sag, theory meets frequencies to 2 %, and its loaded sags are 5 % too small."""
    rows = beam.beam_theory()
    assert all(abs(row["frequency_theory"] / row["frequency"] - 1.0) < 0.02 for row in rows)
    assert rows[0]["sag_theory"] == pytest.approx(rows[0]["sag"])
    assert all(row["sag_theory"] < 0.95 * row["sag"] for row in rows[1:])
    assert all(row["frequency_lever"] < 0.95 * row["frequency"] for row in rows[1:])

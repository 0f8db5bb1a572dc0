# SPDX-License-Identifier: Apache-2.0
"""The measured beam: the evaluation of a recorded swing."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import beam


def test_a_swing_is_read() -> None:
    """Sag, frequency and damping ratio of a synthetic decaying swing are found."""
    times = np.arange(0.0, 2.2, 0.005)
    decay, turn = 0.05 * 2.0 * np.pi * 4.0, 2.0 * np.pi * 4.0 * np.sqrt(1.0 - 0.05**2)
    height = -10.0 * (1.0 - np.exp(-decay * times) * np.cos(turn * times))
    sag, frequency, ratio = beam.swings(times, height)
    assert sag == pytest.approx(10.0, rel=0.01)
    assert frequency == pytest.approx(4.0, rel=0.01)
    assert ratio == pytest.approx(0.05, rel=0.05)

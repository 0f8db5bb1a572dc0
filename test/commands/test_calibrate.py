# SPDX-License-Identifier: Apache-2.0
"""The calibration of Sec. 4.2.1: simulated bars follow Eq. 7."""

from __future__ import annotations

import pytest

from gdfe_ros.commands import calibrate as calibration
from gdfe_ros.paper.shape_factor import geometric_ratio


def test_published_ratio_inverts_eq_7() -> None:
    """The published modulus ratio inverts R_G of Eq. 7."""
    for ratio in (1.5, 7.0, 59.4):
        assert calibration.find_published_ratio(float(geometric_ratio(ratio))) == pytest.approx(ratio)
    assert calibration.find_published_ratio(1.0) == 1.0


def test_bars_follow_the_calibration(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bars of R_G 1, 5 and 30 have the mean strains of Eq. 7 within 20 %, and equal halves equal strains."""
    monkeypatch.setattr(calibration, "RATIOS", (1.0, 5.0, 30.0))
    points = calibration.calibrate(10)
    assert all(point.converged for point in points)
    assert points[0].strain == pytest.approx(1.0, abs=1e-3)
    for point in points[1:]:
        assert point.strain == pytest.approx(point.published, rel=0.2)

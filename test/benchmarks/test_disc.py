# SPDX-License-Identifier: Apache-2.0
"""The axisymmetric mesh of a ball: valid quadrilaterals that fill the quarter disc, and the rim near the pole."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.peers.disc import quarter_disc


@pytest.mark.parametrize("cells", [2, 6])
def test_it_fills_the_quarter_disc(cells: int) -> None:
    """All cells are convex and counter-clockwise, and their areas sum to the quarter disc's."""
    disc = quarter_disc(cells)
    assert disc.cells.shape == (3 * cells**2, 8)
    corners = disc.points[disc.cells[:, :4]]
    sides = np.roll(corners, -1, axis=1) - corners
    following = np.roll(sides, -1, axis=1)
    assert (sides[..., 0] * following[..., 1] > sides[..., 1] * following[..., 0]).all()
    x, y = np.moveaxis(corners, 2, 0)
    areas = 0.5 * (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)
    assert areas.sum() == pytest.approx(np.pi / 4, rel=0.3 / cells**2)
    ends = disc.points[disc.cells[:, :4]], np.roll(disc.points[disc.cells[:, :4]], -1, axis=1)
    middles = disc.points[disc.cells[:, 4:]]
    assert np.abs(middles - 0.5 * (ends[0] + ends[1])).max() < 0.3 / cells


def test_its_rim_is_the_circle_about_the_pole() -> None:
    """The rim's sides follow one another on the unit circle, from the pole to 45 degrees."""
    disc = quarter_disc(5)
    ends = np.array([disc.cells[cell][[side, (side + 1) % 4]] for cell, side in disc.rim])
    np.testing.assert_allclose(np.linalg.norm(disc.points[ends], axis=2), 1.0)
    angles = np.sort(np.arctan2(*np.moveaxis(disc.points[ends], 2, 0)), axis=1)
    np.testing.assert_allclose(angles[1:, 0], angles[:-1, 1])
    assert (angles[0, 0], angles[-1, 1]) == pytest.approx((0.0, np.pi / 4))

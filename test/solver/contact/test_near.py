# SPDX-License-Identifier: Apache-2.0
"""The search for boxes that come near each other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from gdfe_ros.solver.contact.near import boxes_around, find_near, make_ragged


@pytest.mark.parametrize("within", [0.0, 0.05])
def test_all_boxes_within_a_distance_are_found_once_but_for_kin(within: float) -> None:
    """The pairs are those of a comparison of all with all; a box with a point among the other's kin is left out."""
    random = np.random.default_rng(7)
    x, groups, others = (
        random.uniform(size=(300, 3)),
        random.integers(0, 300, (80, 2)),
        random.integers(0, 300, (60, 3)),
    )
    x *= [1.0, 3.0, 1.0]
    kin = sparse.random(60, 300, density=0.02, random_state=3, format="csr")
    kin.sort_indices()
    one, two = boxes_around(x, groups), boxes_around(x, others)
    found = find_near(one, two, groups, make_ragged(kin), within)
    meet = (one[:, None, 0] <= two[None, :, 1] + within).all(axis=2) & (
        one[:, None, 1] >= two[None, :, 0] - within
    ).all(axis=2)
    alien = ~(kin.toarray() > 0.0)[:, groups].any(axis=2).T
    assert (np.diff(found[1]) >= 0).all()
    np.testing.assert_array_equal(sorted(map(tuple, found.T)), np.argwhere(meet & alien))
    assert 0 < found.shape[1] < meet.sum()


def test_without_boxes_nothing_is_near() -> None:
    """No boxes on either side give no pairs."""
    none, some = np.zeros((0, 2, 3)), np.zeros((1, 2, 3))
    empty = np.zeros(2, np.int64), np.zeros(0, np.int64)
    for one, two in ((none, some), (some, none)):
        assert find_near(one, two, np.zeros((len(one), 1), np.int32), empty, 1.0).shape == (2, 0)


def test_boxes_whose_distance_overflows_are_compared_too() -> None:
    """Positions at both ends of the range of doubles leave one bin along the axis, and the near pair is found."""
    x = np.array([[-1.5e308, 0.0, 0.0], [1.5e308, 0.0, 0.0]])
    points = np.array([[0], [1]], np.int32)
    boxes, empty = boxes_around(x, points), (np.zeros(3, np.int64), np.zeros(0, np.int64))
    np.testing.assert_array_equal(find_near(boxes, boxes, points, empty, 0.0), [[0, 1], [0, 1]])

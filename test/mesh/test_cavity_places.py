# SPDX-License-Identifier: Apache-2.0
"""Surfaces of air are inside of the body, or are named with a place."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from gdfe_ros.mesh.cavities import Surface, find_misplaced_cavities


def _box(edge: float, x: float = 0.0) -> Surface:
    box = trimesh.creation.box((edge, edge, edge)).apply_translation((x, 0.0, 0.0))
    return np.asarray(box.vertices), np.asarray(box.faces)


BODY = _box(0.02)


def test_air_inside_is_accepted() -> None:
    """Two separate pieces of air inside of a body have no defects."""
    assert find_misplaced_cavities(*BODY, [_box(0.004, -0.005), _box(0.004, 0.005)]) == {}


@pytest.mark.parametrize(
    ("edge", "x", "told"),
    [
        (0.018, 0.015, "partly outside: its surface cuts or touches"),
        (0.01, 0.005, "partly outside: its surface cuts or touches"),
        (0.01, 0.05, "outside of the body's material at (0.045, "),
        (0.04, 0.0, "outside of the body's material at (-0.02, "),
    ],
)
def test_air_outside_is_named_with_a_place(edge: float, x: float, told: str) -> None:
    """Air that crosses the body's surface, touches it from inside, is beside it or around it is a defect."""
    found = find_misplaced_cavities(*BODY, [_box(0.002, -0.008), _box(edge, x)])
    if edge < 0.02 and x != 0.015:
        assert list(found) == [1]
    assert told in found[1]
    assert " m; allowed: wholly inside of the body's material; remedy: export all" in found[1]


def test_air_in_air_is_a_defect() -> None:
    """Air within other air, and air in a hollow of the body itself, are defects."""
    assert list(find_misplaced_cavities(*BODY, [_box(0.01), _box(0.004)])) == [1]
    outer, inner = BODY, _box(0.01)
    hollow = np.concatenate([outer[0], inner[0]]), np.concatenate([outer[1], inner[1] + len(outer[0])])
    assert list(find_misplaced_cavities(*hollow, [_box(0.004)])) == [0]


def test_air_that_overlaps_other_air_is_a_defect() -> None:
    """Two pieces of air that cut each other are both named."""
    assert list(find_misplaced_cavities(*BODY, [_box(0.006, -0.002), _box(0.005, 0.002)])) == [0, 1]

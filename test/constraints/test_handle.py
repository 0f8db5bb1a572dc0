# SPDX-License-Identifier: Apache-2.0
"""Handles: sets of vertices that move together."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.constraints import Axis, Handle


def test_centre_is_the_mean_of_the_handles_vertices() -> None:
    """The centre is the mean of the handle's two vertices, independent of the third vertex."""
    vertices = np.array([[0.0, 0.0, 0.0], [9.0, 9.0, 9.0], [2.0, 4.0, 6.0]])
    handle = Handle("tip", np.array([0, 2], dtype=np.int32))
    np.testing.assert_array_equal(handle.centre(vertices), (1.0, 2.0, 3.0))


def test_axes_index_coordinates() -> None:
    """An axis is the index of its coordinate."""
    assert [np.array([5, 6, 7])[axis] for axis in (Axis.X, Axis.Y, Axis.Z)] == [5, 6, 7]


def test_a_fixed_handle_cannot_slide() -> None:
    """A handle that is both fixed and free is refused with its name and a remedy."""
    with pytest.raises(ValueError, match=r"handle 'tip' is fixed and has free axes; drop one"):
        Handle("tip", np.zeros(1, np.int32), fixed=True, free=(Axis.X,))


def test_a_handle_is_held_unless_said_otherwise() -> None:
    """A handle with vertices alone is commanded along every axis and is not fixed."""
    handle = Handle("tip", np.zeros(1, np.int32))
    assert not handle.fixed
    assert handle.free == ()

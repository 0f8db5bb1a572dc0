# SPDX-License-Identifier: Apache-2.0
"""Numbers of options have the ranges of a scene's keys."""

from __future__ import annotations

import pytest

from gdfe_ros.commands.options import require_number
from gdfe_ros.errors import GdfeError
from gdfe_ros.quantity import Quantity

EDGE = Quantity("edge", "m", above=0.0, most=1.0)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 0.0, -1.0, 1.5])
def test_a_number_out_of_range_is_refused(value: float) -> None:
    """A number that is not finite or out of range is refused with option, value and range."""
    with pytest.raises(GdfeError) as caught:
        require_number("--edge", value, EDGE)
    assert str(caught.value).startswith(f"--edge = {value:g}; allowed is a number: 0 < edge [m] <= 1")


def test_a_number_in_range_or_none_is_accepted() -> None:
    """A number within the range, and an option that is not given, are accepted."""
    assert require_number("--edge", 1.0, EDGE) is None
    assert require_number("--edge", None, EDGE) is None

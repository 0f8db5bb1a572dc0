# SPDX-License-Identifier: Apache-2.0
"""A bar that can move: its scene, and simulations of it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import pytest

from gdfe_ros import Simulation
from test.written import simulate

BAR = """
mesh: {bar: {size: [0.1, 0.02, 0.02], cells: [5, 1, 1]}}
materials: {rubber: {law: neo_hookean, young: 1.0e6, poisson: 0.45, density: 1000}}
handles: {base: {where: {face: x-}}}
dynamics: {scheme: newmark, step: 0.002}
"""


@pytest.fixture
def moving() -> Callable[..., Simulation]:
    """Give a function that simulates the bar; keyword arguments override scene keys, ``__`` stands for a dot."""
    return partial(simulate, BAR)

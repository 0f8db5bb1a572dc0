# SPDX-License-Identifier: Apache-2.0
"""A box that is held between two soft pads."""

from __future__ import annotations

from benchmarks.contact import grip
from benchmarks.peers.grip_case import WEIGHT


def test_a_grip_holds_what_friction_can_hold() -> None:
    """A gripped box stays without creep at 1.02 times the least friction coefficient, and falls at 0.98 times it."""
    least = WEIGHT / (2.0 * grip(0.02, seconds=0.0)["press"])
    held, lost = (grip(demand * least, seconds=0.5) for demand in (1.02, 0.98))
    assert abs(held["drift"]) < 1e-7
    assert lost["sunk"] + lost["drift"] > 0.01

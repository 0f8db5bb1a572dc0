# SPDX-License-Identifier: Apache-2.0
"""Orders wait for the next step: the latest one is used, or in lockstep each of them."""

from __future__ import annotations

import threading

import pytest

from gdfe_ros.node.orders import ActuatorOrder, Inbox, Order, PoseOrder, TwistOrder
from gdfe_ros.node.refusals import Reason, Refusal


def _inbox(*, queued: bool, command_set: tuple[str, ...] = ()) -> Inbox:
    return Inbox(threading.Condition(), queued=queued, command_set=command_set)


def _order(value: float) -> ActuatorOrder:
    return ActuatorOrder({"a": value})


def _taken(*orders: Order) -> list[Order]:
    """Put orders of one input; return those that a step of the clocks wall and fast takes."""
    inbox = _inbox(queued=False)
    for order in orders:
        inbox.put("in", order)
    taken = inbox.take()
    assert not inbox.ready()
    return taken


def test_the_latest_command_of_each_handle_counts() -> None:
    """A pose replaces earlier orders of its handle; a velocity is applied after the pose before it."""
    there, back = (PoseOrder("tip", (0.0, 0.0, z), (0.0, 0.0, 0.0, 1.0)) for z in (0.1, 0.0))
    slow, fast = (TwistOrder("tip", (v, 0.0, 0.0), (0.0, 0.0, 0.0)) for v in (0.1, 0.2))
    other = TwistOrder("other", (0.1, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert _taken(there, other, slow, fast) == [there, other, fast]
    assert _taken(other, there, slow, back) == [other, back]


def test_a_flood_is_refused_not_stored() -> None:
    """In lockstep, an order after ten thousand waiting ones is refused, and accepted after a step."""
    inbox = _inbox(queued=True)
    for value in range(10_000):
        inbox.put("a", _order(value))
    with pytest.raises(Refusal) as refusal:
        inbox.put("a", _order(0))
    assert refusal.value.reason is Reason.QUEUE_FULL
    inbox.take()
    inbox.put("a", _order(0))
    inbox.clear()
    assert not inbox.ready()

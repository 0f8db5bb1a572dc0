# SPDX-License-Identifier: Apache-2.0
"""Orders wait for their step: the latest counts, or in lockstep each of them."""

from __future__ import annotations

import threading

import pytest

from gdfe_ros.node.inbox import Inbox
from gdfe_ros.node.orders import ActuatorOrder
from gdfe_ros.node.refusals import Reason, Refusal


def _inbox(*, queued: bool, command_set: tuple[str, ...] = ()) -> Inbox:
    return Inbox(threading.Condition(), queued=queued, command_set=command_set)


def _order(value: float) -> ActuatorOrder:
    return ActuatorOrder({"a": value})


def _values(orders: list) -> list[float]:
    return [order.values["a"] for order in orders]


def test_the_latest_order_of_each_input_counts() -> None:
    """Put three orders of two inputs: one step takes the last of each."""
    inbox = _inbox(queued=False)
    for name, value in (("a", 1), ("b", 2), ("a", 3)):
        inbox.put(name, _order(value))
    assert _values(inbox.take()) == [2, 3]
    assert not inbox.ready()


def test_lockstep_takes_one_order_a_step_in_the_order_received() -> None:
    """Put three orders of two inputs: three steps take one each."""
    inbox = _inbox(queued=True)
    for name, value in (("a", 1), ("b", 2), ("a", 3)):
        inbox.put(name, _order(value))
    assert [_values(inbox.take()) for _ in range(3)] == [[1], [2], [3]]
    assert inbox.take() == []


def test_a_command_set_waits_until_it_is_whole() -> None:
    """Wait for two inputs: a step is ready when both have an order, and takes along a third's."""
    inbox = _inbox(queued=True, command_set=("a", "b"))
    inbox.put("a", _order(1))
    inbox.put("a", _order(2))
    inbox.put("c", _order(3))
    assert not inbox.ready()
    inbox.put("b", _order(4))
    assert inbox.ready()
    assert _values(inbox.take()) == [1, 3, 4]
    assert not inbox.ready()


def test_a_flood_is_refused_not_stored() -> None:
    """Put ten thousand orders in lockstep: the next is refused; after a step there is room for one."""
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

# SPDX-License-Identifier: Apache-2.0
"""Orders wait for the next step: the latest one is used, or in lockstep each of them."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from gdfe_ros.node.driving.orders import ActuatorOrder, Inbox, Order, PoseOrder, TrajectoryOrder, TwistOrder
from gdfe_ros.node.refusals import Reason, Refusal


def _inbox(*, queued: bool, command_set: tuple[str, ...] = ()) -> Inbox:
    return Inbox(threading.Condition(), queued=queued, command_set=command_set)


def _order(value: float) -> ActuatorOrder:
    return ActuatorOrder({"a": value})


def _values(orders: list) -> list[float]:
    return [order.values["a"] for order in orders]


def _taken(*orders: Order) -> list[Order]:
    """Put orders of one input; return those that a step of the clocks wall and fast takes."""
    inbox = _inbox(queued=False)
    for order in orders:
        inbox.put("in", order)
    taken = inbox.remove_next()
    assert not inbox.ready()
    return taken


def test_the_latest_command_of_each_actuator_counts_whoever_sent_it() -> None:
    """Of commands of two actuators by two inputs, a step takes the last one for each actuator."""
    inbox = _inbox(queued=False)
    for name, values in (("x", {"a": 1, "b": 1}), ("y", {"a": 2}), ("x", {"b": 3}), ("x", {})):
        inbox.put(name, ActuatorOrder(values))
    assert [order.values for order in inbox.remove_next()] == [{"a": 2}, {"b": 3}]
    assert not inbox.ready()


def test_the_latest_command_of_each_handle_counts() -> None:
    """A pose replaces earlier orders of its handle; a velocity is applied after the pose before it."""
    there, back = (PoseOrder("tip", (0.0, 0.0, z), (0.0, 0.0, 0.0, 1.0)) for z in (0.1, 0.0))
    slow, fast = (TwistOrder("tip", (v, 0.0, 0.0), (0.0, 0.0, 0.0)) for v in (0.1, 0.2))
    other = TwistOrder("other", (0.1, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert _taken(there, other, slow, fast) == [there, other, fast]
    assert _taken(other, there, slow, back) == [other, back]


def test_a_trajectory_keeps_the_actuators_that_nobody_else_commands() -> None:
    """A command of one actuator ends a trajectory for that actuator only."""
    both = TrajectoryOrder(("a", "b"), None, np.array([1.0]), np.array([[1.0, 2.0]]))
    rest, single = _taken(both, _order(5.0))
    assert (rest.names, rest.values.tolist(), single.values) == (("b",), [[2.0]], {"a": 5.0})
    assert _taken(both, both) == [both]
    assert [type(order) for order in _taken(_order(5.0), both)] == [ActuatorOrder, TrajectoryOrder]


def test_lockstep_takes_one_order_a_step_in_the_order_received() -> None:
    """In lockstep, three orders of two inputs are taken by three steps, in the order received."""
    inbox = _inbox(queued=True)
    for name, value in (("a", 1), ("b", 2), ("a", 3)):
        inbox.put(name, _order(value))
    assert [_values(inbox.remove_next()) for _ in range(3)] == [[1], [2], [3]]
    assert inbox.remove_next() == []


def test_a_command_set_waits_until_it_is_whole() -> None:
    """A step is ready when both inputs of the command set have an order; it also takes the order of a third input."""
    inbox = _inbox(queued=True, command_set=("a", "b"))
    inbox.put("a", _order(1))
    inbox.put("a", _order(2))
    inbox.put("c", _order(3))
    assert not inbox.ready()
    assert inbox.missing() == ["b"]
    inbox.put("b", _order(4))
    assert inbox.ready()
    assert _values(inbox.remove_next()) == [1, 3, 4]
    assert not inbox.ready()


def test_a_flood_is_refused_not_stored() -> None:
    """In lockstep, an order after ten thousand waiting ones is refused, and accepted after a step."""
    inbox = _inbox(queued=True)
    for value in range(10_000):
        inbox.put("a", _order(value))
    with pytest.raises(Refusal) as refusal:
        inbox.put("a", _order(0))
    assert refusal.value.reason is Reason.QUEUE_FULL
    inbox.remove_next()
    inbox.put("a", _order(0))
    inbox.clear()
    assert not inbox.ready()

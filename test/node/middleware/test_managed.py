# SPDX-License-Identifier: Apache-2.0
"""A node survives bad requests: invalid transitions, parameters without a type, callbacks that raise."""

from __future__ import annotations

import gc
import threading
import weakref
from collections.abc import Callable
from typing import Any

import pytest
import rclpy
from geometry_msgs.msg import PoseStamped
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from std_msgs.msg import String

from gdfe_ros.node.middleware.managed import ManagedNode
from test.written import run_python

_STEPS = {"unconfigured": (), "inactive": ("configure",), "active": ("configure", "activate")}
_INVALID = {"unconfigured": (0, 2, 3, 4, 6, 7, 99, 255), "inactive": (0, 1, 4, 5, 7, 10), "active": (0, 1, 2, 3, 6, 99)}

_RAISING = """
import sys, threading
import rclpy
from rclpy.node import Node
from gdfe_ros.node.middleware import process

class Raising(Node):
    def __init__(self, stopping):
        super().__init__("raising")
        self.left, self._stopping = 3, stopping
        self.create_timer(0.01, self._beat)

    def _beat(self):
        self.left -= 1
        if self.left == 0:
            self._stopping.set()
        raise ZeroDivisionError("broken on purpose")

    def close(self):
        print("beats left:", self.left)

sys.exit(process.run(Raising, []))
"""


@pytest.mark.parametrize("state", _STEPS)
def test_transitions_that_a_state_lacks_are_refused(client: Any, start: Callable, coarse: dict, state: str) -> None:
    """Each transition that a state does not have is refused, and the node stays in its state."""
    process = start(**coarse, autostart=False)
    assert all(client.transition(label) for label in _STEPS[state])
    for number in _INVALID[state]:
        request = ChangeState.Request()
        request.transition.id = number
        assert not client.call(ChangeState, "change_state", request).success, number
        assert client.state() == state
    for label in ("nonsense", "transition_success"):
        assert not client.transition(label)
    assert f"the node is {state}; allowed: " in process.log
    assert process.running
    assert client.diagnostics()["state"] == state


@pytest.mark.parametrize(
    ("kind", "name"), [(SetParameters, "set_parameters"), (SetParametersAtomically, "set_parameters_atomically")]
)
def test_a_parameter_of_no_type_is_refused_and_counted(
    client: Any, start: Callable, coarse: dict, kind: type, name: str
) -> None:
    """A parameter of type 99, on which rclpy raises, is refused with the reason and counted."""
    process = start(**coarse)
    bad = Parameter(name="rate", value=ParameterValue(type=99))
    response = client.call(kind, name, kind.Request(parameters=[bad]))
    results = [response.result] if hasattr(response, "result") else response.results
    assert [result.successful for result in results] == [False]
    assert "99 is not a valid" in results[0].reason
    values = client.diagnostics()
    assert values["exceptions in callbacks"] == "1"
    assert "set_parameters" in values["last exception"]
    assert process.running


def test_an_exception_that_leaves_the_executor_ends_nothing() -> None:
    """Three exceptions of a timer in a node without guards are logged with their cause, and the node closes well."""
    done = run_python(_RAISING)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "beats left: 0\n"
    assert "broken on purpose" in done.stderr


def test_what_is_destroyed_is_freed_two_turns_later() -> None:
    """A destroyed subscription or timer is kept for two turns, and no longer; then its callback group forgets it.

    EventsExecutor calls queued entities by address: a node that removed its topics during a flood of messages crashed
    with SIGSEGV. If they stay, their callbacks keep whole simulations in memory.
    """
    context = rclpy.Context()
    rclpy.init(context=context)
    node = ManagedNode("keeper", context=context)
    try:
        known = len(node.default_callback_group.entities)
        made = [node.create_subscription(String, "word", print, 10), node.create_timer(1.0, print)]
        left = [weakref.ref(thing) for thing in made]
        for remove in (node.destroy_subscription, node.destroy_timer):
            assert remove(made.pop(0))
        for kept in (True, True, False):
            gc.collect()
            assert all((reference() is not None) is kept for reference in left)
            node.turn()
        assert len(node.default_callback_group.entities) == known
    finally:
        node.destroy_node()
        rclpy.shutdown(context=context)


def test_topics_have_no_handlers_of_events(ros: Any) -> None:
    """Publishers and subscriptions of a node have no handlers of QoS events, whose removal crashes an executor."""
    node = ros.node(lambda **options: ManagedNode("quiet", **options))
    made = [
        node.create_publisher(String, "word", 10),
        node.create_lifecycle_publisher(String, "word", 10),
        node.create_subscription(String, "word", print, 10),
    ]
    assert [each.event_handlers for each in made] == [[], [], []]


def test_topics_go_in_the_middle_of_a_flood(client: Any, start: Callable, coarse: dict) -> None:
    """Topics are created and removed ten times under thousands of commands without a crash."""
    process = start(**coarse, autostart=False, clock="fast")
    publisher = client.node.create_publisher(PoseStamped, client.full("handles/tip/target"), 1000)
    over = threading.Event()

    def flood() -> None:
        while not over.wait(0.0005):
            publisher.publish(PoseStamped())

    thread = threading.Thread(target=flood)
    thread.start()
    try:
        for _ in range(10):
            for label in ("configure", "activate", "deactivate", "cleanup"):
                assert client.transition(label)
    finally:
        over.set()
        thread.join()
    assert process.stop() == 0

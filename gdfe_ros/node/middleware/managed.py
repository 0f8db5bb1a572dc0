# SPDX-License-Identifier: Apache-2.0
"""Nodes that outlive exceptions in their callbacks, and topics that can be destroyed while an executor spins."""

from __future__ import annotations

import ctypes
import gc
import threading
import traceback
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from functools import partial, wraps
from typing import Any

from lifecycle_msgs.msg import Transition
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.interface import ServiceSpec
from gdfe_ros.node.middleware.ros_types import LARGEST, available, bound_service, interface_class, unread_size
from gdfe_ros.node.refusals import answer, answer_after, fail
from gdfe_ros.untrusted.bounded_text import PlainLog, Throttle

NO_PUBLISHER_EVENTS = PublisherEventCallbacks(use_default_callbacks=False)
NO_SUBSCRIPTION_EVENTS = SubscriptionEventCallbacks(use_default_callbacks=False)


class EventlessNode(Node):
    """A node whose publishers and subscriptions have no handlers of QoS events."""

    def create_publisher(self, *arguments: Any, **options: Any) -> Any:
        """Create a publisher, as rclpy does, without handlers of QoS events."""
        return super().create_publisher(*arguments, event_callbacks=NO_PUBLISHER_EVENTS, **options)

    def create_subscription(self, *arguments: Any, **options: Any) -> Any:
        """Create a subscription, as rclpy does, without handlers of QoS events."""
        return super().create_subscription(*arguments, event_callbacks=NO_SUBSCRIPTION_EVENTS, **options)


_KEPT = 2
"""Number of calls of `ManagedNode.turn` for which a destroyed subscription or timer stays in memory."""
_MOST_ENTRIES = 10_000
"""Largest number of entries in a list of a request; rclpy's answer for 500000 names of parameters takes 15 s."""
_TRIM = getattr(ctypes.CDLL(None), "malloc_trim", None)
"""Function of glibc that returns free memory to the system; None with other C libraries."""
_BURST = 100
"""Largest number of log entries of one severity in five seconds."""
_PRIMARY = ("unconfigured", "inactive", "active")


class Faults:
    """Counts exceptions in callbacks, and logs them with traceback, for each place at most once in five seconds.

    Args:
        log: function that receives the text of an error.

    Attributes:
        count: number of exceptions so far.
        last: place and text of the last exception; empty before the first.
    """

    def __init__(self, log: Callable[[str], object]) -> None:
        self._log, self._lock, self._throttle = log, threading.Lock(), Throttle()
        self.count, self.last = 0, ""

    def note(self, place: str, error: BaseException) -> None:
        """Count and log an exception raised in ``place``."""
        with self._lock:
            self.count += 1
            self.last = f"{place}: {error!r}"
        if (more := self._throttle.due(place)) is not None:
            trace = "".join(traceback.format_exception(error))
            self._log(f"{place} failed, the node goes on{more}: {error!r}\n{trace}")


class ManagedNode(EventlessNode, LifecycleNode):
    """A lifecycle node whose callbacks cannot end the process; topics can be destroyed while an executor spins it.

    Exceptions in callbacks are counted and logged; a service answers with the exception's text. With rclpy alone, such
    an exception ends the executor, even if it only reports a transition that the present state does not allow (rclpy
    #1209). A service's callback may return a ``Future``. The executor then continues, and the response is sent when
    the ``Future`` is complete.

    Attributes:
        faults: counts of exceptions in callbacks.
        prepared: result of ``prepare`` for ``on_configure``, or the exception that ended it; None: it has not run.
    """

    def __init__(self, name: str, **options: Any) -> None:
        self._preparation: threading.Thread | None = None
        self.prepared: Any = None
        self._destroyed = False
        self._turns, self._log_throttle = 0, Throttle(_BURST, what="entries left out")
        self._destroyed_last: deque[tuple[int, Subscription | Timer]] = deque()
        self.faults = Faults(lambda text: self.get_logger().error(text))
        super().__init__(name, **options)
        self._service_change_state.callback = self._check_transition(self._service_change_state.callback)
        for service in self.services:
            self._shield(service)

    def get_logger(self) -> PlainLog:
        """Return the node's logger: entries of limited number and length, without control characters."""
        return PlainLog(super().get_logger(), self._log_throttle)

    @property
    def lifecycle_state(self) -> str:
        """Label of the lifecycle state, e.g. ``active``; ``finalized`` once the node is destroyed."""
        return "finalized" if self._destroyed else self._state_machine.current_state[1]

    @property
    def given_parameters(self) -> dict[str, object]:
        """Dict from name to value of the parameters that were given at start, whether declared or not."""
        # rclpy has no public interface for this.
        return {name: parameter.value for name, parameter in self._parameter_overrides.items()}

    def list_unknown_parameters(self) -> set[str]:
        """Return the names of parameters that were given at start and are not declared.

        Parameters of rclpy are excluded. Young's moduli are excluded, too, because they are declared with the scene.
        """
        later = ("materials.", "qos_overrides.", "start_type_description_service", "use_sim_time")
        return {name for name in self.given_parameters if not self.has_parameter(name) and not name.startswith(later)}

    def offer(self, offered: Mapping[ServiceSpec, Callable[[Any, Any], Any]]) -> None:
        """Offer the services whose types are installed.

        Args:
            offered: dict from service to the function that carries out a request (``action`` of `refusals.answer`).
        """
        for spec, action in offered.items():
            if available(spec.type):
                note = partial(self.faults.note, f"the service {spec.name}")
                callback = partial(answer, action, note=note)
                self._shield(self.create_service(interface_class(spec.type), spec.name, callback))

    def create_timer(self, timer_period_sec: float, callback: Callable[[], None], *more: Any, **options: Any) -> Any:
        """Create a timer that survives exceptions in its callback."""
        return super().create_timer(timer_period_sec, self.guard(callback, "a timer"), *more, **options)

    def create_lifecycle_publisher(self, *arguments: Any, **options: Any) -> Any:
        """Create a publisher of a lifecycle node, as rclpy does, without handlers of QoS events."""
        return super().create_lifecycle_publisher(*arguments, event_callbacks=NO_PUBLISHER_EVENTS, **options)

    def create_subscription(
        self, msg_type: type, topic: str, callback: Callable[..., None], *more: Any, **options: Any
    ) -> Any:
        """Create a subscription that survives exceptions in its callback."""
        guarded = self.guard(callback, f"the subscription of {topic}")
        return super().create_subscription(msg_type, topic, guarded, *more, **options)

    def destroy_subscription(self, subscription: Subscription) -> bool:
        """Destroy a subscription, as rclpy does; its callback is released at once, its memory later (`turn`)."""
        subscription.callback = _ignore
        self._destroyed_last.append((self._turns, subscription))
        return super().destroy_subscription(subscription)

    def destroy_timer(self, timer: Timer) -> bool:
        """Destroy a timer, as rclpy does; its callback is released at once, its memory later (`turn`)."""
        timer.callback = _ignore
        self._destroyed_last.append((self._turns, timer))
        return super().destroy_timer(timer)

    def turn(self) -> None:
        """Free subscriptions and timers destroyed before the previous call; to be called by a timer of this node.

        The queue of EventsExecutor contains addresses of subscriptions and timers. The executor processes the queue in
        order. Once two later calls by a timer are processed, no address of a destroyed object is left in the queue.
        """
        self._turns += 1
        released = False
        while self._destroyed_last and self._destroyed_last[0][0] + _KEPT <= self._turns:
            self._destroyed_last.popleft()
            released = True
        if released:
            self.collect()
            # rclpy keeps a weak reference to each destroyed entity.
            entities = self.default_callback_group.entities
            entities.difference_update([each for each in list(entities) if each() is None])

    @staticmethod
    def collect() -> None:
        """Free the memory of a dropped simulation, and return it to the system.

        A simulation has reference cycles. Python collects them only after many allocations, and a node makes few
        allocations. glibc would keep freed memory in the pools of ended threads: 50 MB after 1000 replacements of the
        scene `grasp`.
        """
        gc.collect()
        if _TRIM is not None:
            _TRIM(0)

    def destroy_node(self) -> None:
        """Destroy the node and its state machine at once.

        rclpy would keep the state machine, and with it the node's name in the graph, until Python collects the node as
        garbage.
        """
        super().destroy_node()
        if not self._destroyed:
            self._destroyed = True
            self._state_machine.destroy_when_not_in_use()

    def guard(self, callback: Callable[..., None], place: str) -> Callable[..., None]:
        """Return a callback that calls ``callback``, and counts and logs its exceptions as faults of ``place``."""

        @wraps(callback)
        def outliving(*arguments: Any) -> None:
            try:
                callback(*arguments)
            except Exception as error:
                self.faults.note(place, error)

        return outliving

    def _shield(self, service: Service) -> None:
        """Make a service answer with a failure if its callback raises, and send a ``Future`` response once it is set.

        A request that is too large, or has a too long list, is refused. Exceptions are counted and logged as faults.
        """
        callback, send, place = service.callback, service.send_response, f"the service {service.srv_name}"
        service.srv_type = bound_service(service.srv_type, self.get_logger().warning)

        def answer(request: Any, response: Any) -> Any:
            if text := _describe_excess(request):
                self.get_logger().warning(f"a request to {service.srv_name} is refused: {text}")
                return _failure(request, type(response)(), text)
            try:
                return callback(request, response)
            except Exception as error:
                self.faults.note(place, error)
                return _failure(request, type(response)(), repr(error))

        def send_now_or_later(response: Any, header: Any) -> None:
            if isinstance(response, Future):
                response.add_done_callback(lambda done: deliver(done.result(), header))
            else:
                deliver(response, header)

        def deliver(response: Any, header: Any) -> None:
            try:
                send(response, header)
            except Exception as error:  # the client, or this node's context, may have shut down
                self.faults.note(place, error)

        service.callback, service.send_response = answer, send_now_or_later

    def prepare(self) -> Any:
        """Do the slow part of ``on_configure``; called in a separate thread, so it must not use ROS."""

    def configure_later(self) -> Future[TransitionCallbackReturn]:
        """Start the transition ``configure`` without blocking other callbacks; return a ``Future`` of its result.

        The state is ``configuring`` until ``prepare`` is done.
        """
        before = LifecycleState(self._state_machine.current_state[1], self._state_machine.current_state[0])
        self._state_machine.trigger_transition_by_id(Transition.TRANSITION_CONFIGURE, True)
        future: Future = Future()

        def finish(prepared: Any) -> None:
            self.prepared = prepared
            future.set_result(self._conclude(self.on_configure(before), before))

        self._preparation = self.in_background(self.prepare, finish, name="prepare")
        return future

    def in_background(
        self, work: Callable[[], object], finish: Callable[[Any], object], *, name: str
    ) -> threading.Thread:
        """Run ``work`` in a new thread, and then ``finish`` once in the executor's thread; return the thread.

        The argument of ``finish`` is the result of ``work``, or the exception that ended it.
        """
        outcome: list[Any] = []

        def finish_once() -> None:
            self.destroy_timer(finisher)
            if outcome:  # an executor may have queued the timer's callback twice
                finish(outcome.pop())

        def run() -> None:
            try:
                outcome.append(work())
            except Exception as error:
                outcome.append(error)
            finisher.reset()

        finisher = self.create_timer(0.0, finish_once, clock=Clock(clock_type=ClockType.STEADY_TIME), autostart=False)
        thread = threading.Thread(target=run, name=name, daemon=True)
        thread.start()
        return thread

    def await_preparation(self) -> None:
        """Wait for the end of ``prepare`` if it is running."""
        if self._preparation is not None:
            self._preparation.join()

    def _answer_configure(self, response: Any) -> Future:
        def respond(done: Future[TransitionCallbackReturn]) -> Any:
            response.success = done.result() is TransitionCallbackReturn.SUCCESS
            return response

        return answer_after(self.configure_later(), respond)

    def _conclude(self, code: TransitionCallbackReturn, before: LifecycleState) -> TransitionCallbackReturn:
        """Complete a transition with its result code, as rclpy does, and return the code."""
        self._state_machine.trigger_transition_by_label(code.to_label(), True)
        if code is TransitionCallbackReturn.ERROR:
            self._state_machine.trigger_transition_by_label(self.on_error(before).to_label(), True)
        return code

    def _check_transition(self, change: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
        """Return a callback that refuses transitions that the present state does not allow.

        The transition ``configure`` is made by `configure_later`, all others by ``change``.
        """

        def answer(request: Any, response: Any) -> Any:
            wanted, state = request.transition, self.lifecycle_state
            primary = state in _PRIMARY  # other states have only rcl's internal transitions
            offered = self._state_machine.available_transitions if primary else ()
            allowed = {label: number for number, label, *_ in offered}
            if wanted.label in allowed or (not wanted.label and wanted.id in allowed.values()):
                if "configure" in allowed and allowed["configure"] == (allowed.get(wanted.label) or wanted.id):
                    return self._answer_configure(response)
                return change(request, response)
            given = repr(wanted.label) if wanted.label else f"id {wanted.id}"
            offers = ", ".join(f"{label} ({number})" for label, number in allowed.items())
            self.get_logger().warning(f"transition {given} refused: the node is {state}; allowed: {offers or 'none'}")
            response.success = False
            return response

        return answer


def _ignore(*_: Any) -> None:
    """Receive a message of a destroyed subscription, or the call of a destroyed timer."""


def _describe_excess(request: Any) -> str:
    """Return a text about a request that is too large, or has a list that is too long; else an empty text."""
    if size := unread_size(request):
        return f"it has {size} bytes; allowed: up to {LARGEST}"
    for name, kind in request.get_fields_and_field_types().items():
        if kind.startswith("sequence") and (count := len(getattr(request, name))) > _MOST_ENTRIES:
            return f"{name} has {count} entries; allowed: up to {_MOST_ENTRIES}"
    return ""


def _failure(request: Any, response: Any, text: str) -> Any:
    """Put the reason of a failure into the response, and return it."""
    refused = SetParametersResult(successful=False, reason=text)
    if hasattr(request, "parameters") and hasattr(response, "results"):
        response.results = [refused] * max(1, min(len(request.parameters), _MOST_ENTRIES))
    elif isinstance(getattr(response, "result", None), SetParametersResult):
        response.result = refused
    else:
        fail(response, GdfeError(text))
    return response

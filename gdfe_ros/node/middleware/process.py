# SPDX-License-Identifier: Apache-2.0
"""The process of a node: signals, executor, orderly shutdown."""

from __future__ import annotations

import io
import os
import re
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType
from typing import Any, Self

import rclpy
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.executors import Executor, ExternalShutdownException, MultiThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerOptions

from gdfe_ros.entry import NODE_ENDINGS, catch_endings
from gdfe_ros.errors import GdfeError
from gdfe_ros.node.middleware.managed import EventlessNode, Faults, ManagedNode

_WAIT = 0.5
"""Longest wait of the executor [s]; a signal ends the wait at once."""
_BAD_START = 2
"""Exit status of a process whose nodes cannot be made, or whose arguments are unknown."""
_START_ERRORS = (
    GdfeError,
    InvalidParameterTypeException,
    InvalidParameterValueException,
    rclpy_implementation.RCLError,
    rclpy_implementation.RCLInvalidROSArgsError,
    rclpy_implementation.UnknownROSArgsError,
)
_PLACES = re.compile(r"\s*, at \S+:\d+")
"""Pattern of the source locations in rcl's error messages."""
_MOST_FAULTS = 1000
"""The process ends after more than this number of successive exceptions of the executor."""
_INSIST = 2.0
"""A signal ends the process at once if it comes later than this time [s] after the first signal."""


def make_executor(context: rclpy.Context | None = None) -> Executor:
    """Return the fastest executor: EventsExecutor if rclpy has it and it starts, else a multi-threaded one.

    EventsExecutor requires that the standard error has a file descriptor. A captured standard error, in a test or a
    notebook, may have none.
    """
    try:
        from rclpy.experimental import EventsExecutor

        return EventsExecutor(context=context)
    except (ImportError, io.UnsupportedOperation):
        return MultiThreadedExecutor(num_threads=2, context=context)


class LoneNode:
    """A ROS node with its own executor and its own ROS context; the process may have other contexts.

    Signals are not handled. As a context manager, it is closed at exit.

    Args:
        name: name of the node.
        context: context of the node; None: a new one.
        options: further options of rclpy's node, e.g. ``namespace``.

    Attributes:
        node: the ROS node.
        executor: executor of the node.
        context: context of the node.
    """

    def __init__(self, name: str, *, context: rclpy.Context | None = None, **options: Any) -> None:
        self.context = context or rclpy.Context()
        rclpy.init(context=self.context, signal_handler_options=SignalHandlerOptions.NO)
        self.node = EventlessNode(name, context=self.context, **options)
        self.executor = make_executor(self.context)
        self.executor.add_node(self.node)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Destroy the node and shut down its context."""
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)


def run(make_node: Callable[[threading.Event], Any], args: list[str] | None = None) -> int:
    """Spin one node; see ``run_all``."""
    return run_all(lambda stopping: [make_node(stopping)], args)


def run_all(make_nodes: Callable[[threading.Event], Sequence[Any]], args: list[str] | None = None) -> int:
    """Spin nodes until SIGINT, SIGTERM, SIGHUP or a shutdown of ROS, then close them in order.

    rclpy's own signal handlers are not used, because they remove the topics while the threads still publish.

    Args:
        make_nodes: function that makes the nodes; its argument is an event that a signal sets. Each node must have a
            method ``close``, and may have an attribute ``status``.
        args: arguments of the command line; None: those of the process.

    Returns:
        Exit status: the largest ``status`` of a node, usually 0; or 2 if the nodes cannot be made, e.g. because the
        value of a parameter is not allowed.
    """
    stopping = threading.Event()
    _catch_signals(stopping)
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        nodes = make_nodes(stopping)
    except _START_ERRORS as error:
        text = _PLACES.sub("", str(error))
        print(f"{Path(sys.argv[0]).stem}: {text}", file=sys.stderr)
        rclpy.try_shutdown()
        return _BAD_START
    executor = make_executor()
    for node in nodes:
        executor.add_node(node)
    try:
        _spin(executor, nodes, stopping)
    except ExternalShutdownException:
        pass
    finally:
        for node in nodes:
            node.close()
            executor.remove_node(node)
        executor.shutdown()
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()
    return max((getattr(node, "status", 0) for node in nodes), default=0)


def answer_arguments(name: str, usage: str, args: Sequence[str] | None = None) -> int | None:
    """Print the usage on ``--help``, and refuse arguments that do not belong to ROS.

    Args:
        name: name of the program.
        usage: text that ``--help`` prints.
        args: arguments of the command line; None: those of the process.

    Returns:
        Exit status; None if the program is to run.
    """
    others = _without_ros(sys.argv[1:] if args is None else args)
    if {"-h", "--help"} & set(others):
        print(usage.strip())
        return 0
    if others:
        print(f"{name}: unknown arguments {' '.join(others)}; see {name} --help", file=sys.stderr)
        return _BAD_START
    return None


def _without_ros(args: Sequence[str]) -> list[str]:
    """Return the arguments that do not belong to ROS. rclpy's own function fails for an invalid parameter file."""
    others, ours = [], True
    for argument in args:
        if argument == "--ros-args" or (argument == "--" and not ours):
            ours = argument == "--"
        elif ours and ":=" not in argument:  # a remapping in the old syntax stands alone
            others.append(argument)
    return others


def _spin(executor: Executor, nodes: Sequence[Any], stopping: threading.Event) -> None:
    """Spin until ``stopping`` is set.

    Spinning continues after exceptions, e.g. for a request that rclpy cannot deserialise, but not after `_MOST_FAULTS`
    in a row.
    """
    faults = [node.faults for node in nodes if isinstance(node, ManagedNode)]
    faults = faults or [Faults(lambda text: nodes[0].get_logger().error(text))]
    in_a_row = 0
    while rclpy.ok() and not stopping.is_set():
        try:
            # EventsExecutor.spin never returns; a loop of spin_once costs no more.
            executor.spin_once(timeout_sec=_WAIT)
            in_a_row = 0
        except ExternalShutdownException:
            raise
        except Exception as error:
            in_a_row += 1
            if in_a_row > _MOST_FAULTS:
                raise
            for each in faults:
                each.note("the executor", error)


def _catch_signals(stopping: threading.Event) -> None:
    """Make SIGINT, SIGTERM and SIGHUP set an event; a second one, more than `_INSIST` later, ends the process at once.

    The second signal is needed because the event ends neither a compilation of kernels nor a long solve at once.
    Signals in quick succession count as one, because a terminal sends SIGINT to every process of its group, and a
    launch may send it again.
    """
    first: list[float] = []

    def catch(number: int, frame: FrameType | None) -> None:
        now = time.monotonic()
        if first and now > first[0] + _INSIST:
            os.write(sys.stderr.fileno(), b"ended at once; `gdfe recover` completes a bag that was cut off\n")
            os._exit(128 + number)
        if not first:
            first.append(now)
            stopping.set()

    catch_endings(catch, always=NODE_ENDINGS)

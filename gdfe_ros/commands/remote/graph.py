# SPDX-License-Identifier: Apache-2.0
"""The commands for other nodes: ``gdfe topics``, nodes, params, lifecycle, hz, pub, echo and call."""

from __future__ import annotations

import argparse
import sys
from itertools import islice

import numpy as np

from gdfe_ros.commands.remote.message_text import parse, show
from gdfe_ros.commands.remote.peer import Peer, full_name, get_parameters, set_parameter
from gdfe_ros.errors import GdfeError
from gdfe_ros.untrusted.bounded_text import plain_lines
from gdfe_ros.untrusted.spelling import did_you_mean

REFUSED = 1


def _add_wait(parser: argparse.ArgumentParser, *, what: str = "the answer", seconds: float = 60.0) -> None:
    text = f"longest wait for {what} (default: {seconds:g} s)"
    parser.add_argument("--wait", type=float, default=seconds, metavar="S", help=text)


def add_topics(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``topics``."""
    parser.add_argument("part", nargs="?", default="", help="list only topics whose names contain this text")


def list_topics(arguments: argparse.Namespace) -> int:
    """Print a line for each topic: name, type, publishers, subscriptions; return 0, or 1 if no topic is listed."""
    with Peer() as peer:
        found = [row for row in peer.topics() if arguments.part in row[0]]
    rows = [("topic", "type", "publishers", "subscriptions"), *found]
    widths = [max(len(str(row[column])) for row in rows) for column in range(3)]
    for *cells, last in rows:
        print(*(f"{cell!s:{width}}" for cell, width in zip(cells, widths, strict=True)), last)
    return 0 if found else 1


def add_nodes(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``nodes``: none."""


def list_nodes(arguments: argparse.Namespace) -> int:
    """Print the full name of each node; return 0."""
    with Peer() as peer:
        print(*peer.nodes(), sep="\n")
    return 0


def add_params(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``params``."""
    parser.add_argument("node", help="name of the node, e.g. /gdfe_sim")
    parser.add_argument("name", nargs="?", help="name of one parameter (default: all are printed)")
    parser.add_argument("value", nargs="?", help="new value in YAML, e.g. 0.02")
    _add_wait(parser)


def show_params(arguments: argparse.Namespace) -> int:
    """Print parameters as YAML after a requested change; return 0, or 1 if the node refused the change."""
    node, wanted = full_name(arguments.node), arguments.name
    with Peer() as peer:
        names = peer.call(f"{node}/list_parameters", {}, patience=arguments.wait).result.names
        if wanted is not None and wanted not in names:
            raise GdfeError(
                f"{node} has no parameter {wanted!r}; {did_you_mean(wanted, names)}names: {', '.join(names)}"
            )
        names = sorted(names) if wanted is None else [wanted]
        values = get_parameters(peer, node, names, patience=arguments.wait)
        if arguments.value is not None:
            value = parse(arguments.value)
            if isinstance(values[0], float) and type(value) is int:
                value = float(value)  # an integer is a number for a parameter that has a decimal point
            answer = set_parameter(peer, node, wanted, value, patience=arguments.wait)
            if not answer.successful:
                print(plain_lines(f"refused: {answer.reason}"), file=sys.stderr)
                return REFUSED
            values = [value]
    for name, value in zip(names, values, strict=True):
        print(plain_lines(f"{name}: {value}"))
    return 0


def add_lifecycle(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``lifecycle``."""
    parser.add_argument("node", help="name of the node, e.g. /gdfe_sim")
    parser.add_argument("transition", nargs="?", help="e.g. configure, activate, deactivate, cleanup, shutdown")
    _add_wait(parser)


def change_lifecycle(arguments: argparse.Namespace) -> int:
    """Print the state of a node, after the transition if one was requested; return 0, or 1 if it failed."""
    name, patience = full_name(arguments.node), arguments.wait
    with Peer() as peer:
        done, wanted = True, arguments.transition
        offered = peer.call(f"{name}/get_available_transitions", {}, patience=patience).available_transitions
        if wanted is not None:
            labels = {each.transition.label: each.transition.id for each in offered}
            if wanted not in labels:
                allowed = ", ".join(labels) or "none"
                raise GdfeError(f"no transition {wanted!r} here; {did_you_mean(wanted, labels)}allowed: {allowed}")
            request = {"transition": {"id": labels[wanted]}}
            done = peer.call(f"{name}/change_state", request, patience=patience).success
            offered = peer.call(f"{name}/get_available_transitions", {}, patience=patience).available_transitions
        state = peer.call(f"{name}/get_state", {}, patience=patience).current_state.label
    labels = ", ".join(each.transition.label for each in offered) or "none"
    print(plain_lines(f"{name}: {state}; transitions: {labels}"))
    if not done:
        print(f"{wanted} failed; the node's log gives the reason")
    return 0 if done else REFUSED


def add_hz(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``hz``."""
    parser.add_argument("topic", help="name of the topic, e.g. /gdfe_sim/mesh")
    parser.add_argument("--count", type=int, default=50, help="number of messages to measure, at most (default: 50)")
    parser.add_argument(
        "--seconds", type=float, default=5.0, metavar="S", help="end after this time, with two messages (default: 5 s)"
    )
    _add_wait(parser, what="each message", seconds=10.0)


def measure_rate(arguments: argparse.Namespace) -> int:
    """Print the rate of a topic and the intervals between messages; return 0."""
    if arguments.count < 2:
        raise GdfeError(f"--count {arguments.count}; allowed: 2 or more")
    times: list[float] = []
    with Peer() as peer:
        for time in peer.arrivals(arguments.topic, patience=arguments.wait):
            times.append(time)
            late = len(times) > 1 and time - times[0] > arguments.seconds
            if late or len(times) == arguments.count:
                break
    gaps = np.diff(times)
    print(
        f"{full_name(arguments.topic)}: {1.0 / gaps.mean():.4g} Hz; intervals of {len(times)} messages: "
        f"{1e3 * gaps.min():.3g} to {1e3 * gaps.max():.3g} ms, standard deviation {1e3 * gaps.std():.2g} ms"
    )
    return 0


def add_pub(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``pub``."""
    parser.add_argument("--once", action="store_true", help="publish one message, as always")
    parser.add_argument("topic", help="name of the topic, e.g. /gdfe_sim/actuation; its type comes from the subscriber")
    parser.add_argument(
        "message", nargs="?", default="{}", help='message in YAML, e.g. "{name: [flexor], effort: [4.0]}"'
    )


def publish(arguments: argparse.Namespace) -> int:
    """Publish a message; return 0 once every subscriber has received it, or 1 if one of them refused it."""
    values = parse(arguments.message)
    with Peer() as peer:
        count, refusals = peer.publish(arguments.topic, values)
    print(f"published on {full_name(arguments.topic)} to {count} listener{'s' if count > 1 else ''}")
    if ".nan" in arguments.message.lower():
        print("NaN means: no command; what is commanded there stays as it is")
    for refusal in refusals:
        print(plain_lines(f"refused: {refusal}"), file=sys.stderr)
    return REFUSED if refusals else 0


def add_echo(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``echo``."""
    parser.add_argument("topic", help="name of the topic, e.g. /gdfe_sim/probe/tip; its type comes from the publisher")
    parser.add_argument(
        "--count", type=int, default=1, help="number of messages: the latest one and the next ones (default: 1)"
    )
    parser.add_argument("--once", action="store_const", const=1, dest="count", help="one message, the default")
    _add_wait(parser, what="each message")


def echo(arguments: argparse.Namespace) -> int:
    """Print messages as YAML; return 0 after the requested number of messages."""
    if arguments.count < 1:
        raise GdfeError(f"--count {arguments.count}; allowed: 1 or more")
    with Peer() as peer:
        for message in islice(peer.listen(arguments.topic, patience=arguments.wait), arguments.count):
            print(show(message), "---", sep="\n", flush=True)
    return 0


def add_call(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``call``."""
    parser.add_argument("service", help="name of the service, e.g. /gdfe_sim/record")
    parser.add_argument("request", nargs="?", default="{}", help='request in YAML, e.g. "{data: true}"')
    _add_wait(parser)


def call(arguments: argparse.Namespace) -> int:
    """Call a service and print its response as YAML; return 0, or 1 if the response reports a failure."""
    values = parse(arguments.request)
    with Peer() as peer:
        response = peer.call(arguments.service, values, patience=arguments.wait)
    print(show(response))
    return 0 if getattr(response, "success", True) else REFUSED


COMMANDS = {
    "topics": (add_topics, list_topics),
    "nodes": (add_nodes, list_nodes),
    "params": (add_params, show_params),
    "lifecycle": (add_lifecycle, change_lifecycle),
    "hz": (add_hz, measure_rate),
    "pub": (add_pub, publish),
    "echo": (add_echo, echo),
    "call": (add_call, call),
}

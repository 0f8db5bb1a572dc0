# SPDX-License-Identifier: Apache-2.0
"""``gdfe lifecycle``: print the state of a lifecycle node and its transitions, or request a transition."""

from __future__ import annotations

import argparse

from gdfe_ros.bounded_text import plain_lines
from gdfe_ros.errors import GdfeError
from gdfe_ros.node.peer import full_name, open_peer
from gdfe_ros.spelling import did_you_mean

REFUSED = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("node", help="name of the node, e.g. /gdfe_sim")
    parser.add_argument("transition", nargs="?", help="e.g. configure, activate, deactivate, cleanup, shutdown")
    parser.add_argument(
        "--wait", type=float, default=60.0, metavar="S", help="longest wait for the answer (default: 60 s)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the state of the node, after the transition if one was requested; return 0, or 1 if it failed."""
    name, patience = full_name(arguments.node), arguments.wait
    with open_peer() as peer:
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

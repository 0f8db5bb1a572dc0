# SPDX-License-Identifier: Apache-2.0
"""Reports of a node on ``/diagnostics``."""

from __future__ import annotations

from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

_ACTIVE, _RECORDING, _PAUSED = "active", "recording", "paused"
"""Texts in a node's report: its lifecycle state, its message while it writes a bag, and its clock while paused."""


@dataclass(frozen=True)
class NodeReport:
    """Report that a node publishes once a second.

    Attributes:
        text: activity or problem of the node; empty if the node is active without problems.
        bad: whether there is a problem.
        paused: whether the node is paused.
        bag: path of the bag that the node writes, or None.
    """

    text: str = ""
    bad: bool = False
    paused: bool = False
    bag: str | None = None

    @classmethod
    def of(cls, message: DiagnosticArray, name: str) -> NodeReport | None:
        """Return the report of the node with this full name; None if the message does not contain it."""
        parts = {status.name: status for status in message.status}
        whole, recording, clock = (
            parts.get(f"{name.lstrip('/')}: {part}") for part in ("simulation", "recording", "clock")
        )
        if whole is None:
            return None
        values, bad = _values(whole), whole.level != DiagnosticStatus.OK
        work = values.get("working on", "")
        text = whole.message if bad or values.get("state") != _ACTIVE else work
        return cls(
            text=text,
            bad=bad or values.get("state") != _ACTIVE,
            paused=clock is not None and _values(clock).get("clock") == _PAUSED,
            bag=_values(recording).get("bag") if recording is not None and recording.message == _RECORDING else None,
        )


def _values(status: DiagnosticStatus) -> dict[str, str]:
    return {pair.key: pair.value for pair in status.values}

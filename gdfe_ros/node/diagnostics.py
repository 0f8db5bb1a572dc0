# SPDX-License-Identifier: Apache-2.0
"""/diagnostics: how the node is doing, once a second."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from gdfe_ros.node import interface
from gdfe_ros.node.channel import Channel
from gdfe_ros.node.managed import ManagedNode
from gdfe_ros.node.refusals import RefusalLog
from gdfe_ros.node.session import Session


class Diagnostics:
    """Publishes one status about the node; nothing is built while nobody listens.

    Args:
        node: that it is about.
        refusals: counts of commands.
    """

    def __init__(self, node: ManagedNode, refusals: RefusalLog) -> None:
        self._node, self._refusals = node, refusals
        self._channel = Channel(node, interface.DIAGNOSTICS)
        self._mark = _Mark()

    def publish(self, session: Session | None, state: str, problem: str) -> None:
        """Publish the status.

        Args:
            session: what runs, or None.
            state: of the lifecycle.
            problem: why configuring, activating or stepping failed last; empty: nothing did.
        """
        # Before anything is read: who waits for a later stamp than now reads nothing that is older.
        now = self._node.get_clock().now()
        values: dict[str, object] = {"state": state}
        level, message = DiagnosticStatus.OK, state
        before = self._mark
        if session is not None:
            values |= self._session_values(session)
            level, message = _judge(session, state, self._mark.overruns - before.overruns)
        if problem:
            level, message = DiagnosticStatus.ERROR, problem
        if not self._channel.wanted:
            return
        values |= self._refusals.counts()
        faults = self._node.faults
        values |= {"exceptions in callbacks": faults.count}
        if faults.count:
            values |= {"last exception": faults.last}
        status = DiagnosticStatus(
            level=level,
            name=f"{self._node.get_fully_qualified_name().lstrip('/')}: simulation",
            message=message,
            hardware_id=session.scene.name if session else "",
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = now.to_msg()
        self._channel.send(array, now.nanoseconds)

    def _session_values(self, session: Session) -> Mapping[str, object]:
        """Collect counts and figures of the run; rates are over the time since the last call."""
        last, mark = self._mark, _Mark.of(session)
        self._mark = mark
        span, steps = max(mark.wall - last.wall, 1e-9), mark.steps - last.steps
        values: dict[str, object] = {
            "scene": session.scene.name,
            "clock": "paused" if session.stepper.paused else session.mode.value,
            "steps": mark.steps,
            "simulation time [s]": f"{mark.simulation:.9g}",
            "real-time factor": f"{max(0.0, mark.simulation - last.simulation) / span:.4g}",
            "steps per second": f"{max(0, steps) / span:.4g}",
            "overruns": mark.overruns,
        }
        if steps > 0:
            values["solve time per step [ms]"] = f"{1e3 * (mark.solving - last.solving) / steps:.3f}"
            values["other time per step [ms]"] = f"{1e3 * (mark.other - last.other) / steps:.3f}"
        return values | _step_values(session) | _bag_values(session)


@dataclass(frozen=True)
class _Mark:
    """Readings of the run at one moment."""

    wall: float = field(default_factory=time.monotonic)
    simulation: float = 0.0
    steps: int = 0
    solving: float = 0.0
    other: float = 0.0
    overruns: int = 0

    @classmethod
    def of(cls, session: Session) -> _Mark:
        stepper, courier = session.stepper, session.courier
        other = stepper.spent - stepper.solving + (courier.spent if courier else 0.0)
        pace = session.pace
        overruns = pace.overruns if pace else 0
        return cls(time.monotonic(), session.simulation.time, stepper.count, stepper.solving, other, overruns)


def _step_values(session: Session) -> Mapping[str, object]:
    if session.last is None:
        return {}
    result = session.last.result
    return {
        "converged": result.converged,
        "iterations": result.iterations,
        "residual": f"{result.residual:.3e}",
        "energy [J]": f"{result.energy:.6g}",
        "least det F": f"{result.min_det:.4g}",
        "policy": result.policy.value,
        "factorisation": result.factorisation,
        **{f"skipped: {name}": count for name, count in result.skipped.items()},
    }


def _bag_values(session: Session) -> Mapping[str, object]:
    if session.bags.recorder is None:
        return {}
    status = session.bags.recorder.status
    return {
        "bag": session.bags.recorder.path,
        "messages written": status.written,
        "messages dropped": status.dropped_total,
        "bag error": status.error or "none",
    }


def _judge(session: Session, state: str, overruns: int) -> tuple[bytes, str]:
    """Choose level and message: an error of the bag, a state that is not converged, drops, overruns since the last."""
    status = session.bags.recorder.status if session.bags.recorder else None
    if status is not None and status.error is not None:
        return DiagnosticStatus.ERROR, str(status.error)
    if session.last is not None and not session.last.result.converged:
        return DiagnosticStatus.WARN, f"not converged: {session.last.result.message or 'cut by the deadline'}"
    if status is not None and status.dropped_total:
        return DiagnosticStatus.WARN, f"{status.dropped_total} messages are not in the bag"
    if overruns > 0:
        text = f"{overruns} overruns since the last report: steps take longer than 1/rate, simulation time falls behind"
        return DiagnosticStatus.WARN, text
    return DiagnosticStatus.OK, state

# SPDX-License-Identifier: Apache-2.0
"""Status of the node and of its parts on /diagnostics, once a second."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from gdfe_ros.node.driving.pace import ClockMode
from gdfe_ros.node.interface import topics
from gdfe_ros.node.middleware.channel import Channel, Doubles
from gdfe_ros.node.middleware.managed import ManagedNode
from gdfe_ros.node.refusals import RefusalLog
from gdfe_ros.node.simulation_session import SimulationSession

_LONG = 0.5
"""A task is reported if it takes longer than this time [s]."""
_OK, _WARN, _ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


@dataclass(frozen=True)
class _Part:
    """Status of one part of the node; ``reason`` explains its level."""

    values: Mapping[str, object]
    level: bytes = _OK
    reason: str = "ok"


@dataclass(frozen=True)
class _Mark:
    """Wall time, simulation time and counters of the run at one moment."""

    wall: float = field(default_factory=time.monotonic)
    simulation: float = 0.0
    steps: int = 0
    solving: float = 0.0
    other: float = 0.0
    overruns: int = 0
    late: float = 0.0

    @classmethod
    def of(cls, session: SimulationSession) -> _Mark:
        stepper, step_publisher = session.stepper, session.step_publisher
        other = stepper.spent - stepper.solving + (step_publisher.spent if step_publisher else 0.0)
        pace = session.run.pace
        overruns, late = (pace.overruns, pace.late) if pace else (0, 0.0)
        return cls(time.monotonic(), session.simulation.time, stepper.count, stepper.solving, other, overruns, late)


class Diagnostics:
    """Publishes a status of the node and one of each part: solver, commands, recording, clock.

    The status of the node has the level and the reason of the worst part. After a failed transition or step, its level
    is error. No message is built without a subscriber.

    Args:
        node: the reporting node.
        refusals: counts of accepted and refused commands.
    """

    def __init__(self, node: ManagedNode, refusals: RefusalLog) -> None:
        self._node, self._refusals = node, refusals
        self._channel = Channel(node, topics.DIAGNOSTICS)
        self._doubles = Doubles(node)
        self._mark, self._refused, self._faults = _Mark(), 0, 0

    def publish(self, session: SimulationSession | None, state: str, problem: str) -> None:
        """Publish the statuses.

        Args:
            session: the running session, or None.
            state: lifecycle state.
            problem: why the last ``configure`` or ``activate`` failed; empty if it succeeded.
        """
        # Stamped before anything is read, so that no status is older than its stamp.
        now = self._node.get_clock().now()
        self._doubles.look()
        parts = self._parts(session)
        if not self._channel.wanted:
            return
        worst = max(parts.values(), key=lambda part: part.level[0])
        level, message = (worst.level, worst.reason) if worst.level != _OK else (_OK, state)
        if failure := problem or (session.stepper.failure if session else ""):
            level, message = _ERROR, failure
        whole = _Part(self._whole(session, state), level, message)
        name = self._node.get_fully_qualified_name().lstrip("/")
        array = DiagnosticArray(
            status=[
                DiagnosticStatus(
                    level=part.level,
                    name=f"{name}: {title}",
                    message=part.reason,
                    hardware_id=session.scene.name if session else "",
                    values=[KeyValue(key=key, value=str(value)) for key, value in part.values.items()],
                )
                for title, part in {"simulation": whole, **parts}.items()
            ]
        )
        array.header.stamp = now.to_msg()
        self._channel.send(array, now.nanoseconds)

    def _whole(self, session: SimulationSession | None, state: str) -> Mapping[str, object]:
        values: dict[str, object] = {"state": state, topics.PROCESS: os.getpid()}
        if session is not None:
            values |= {"scene": session.scene.name, **_work(session)}
        values |= {"exceptions in callbacks": self._node.faults.count}
        return values | ({"last exception": self._node.faults.last} if self._node.faults.count else {})

    def _parts(self, session: SimulationSession | None) -> dict[str, _Part]:
        parts = {"commands": self._commands(session)}
        if session is not None:
            last, self._mark = self._mark, _Mark.of(session)
            parts = {"solver": _solver(session, last, self._mark), **parts, "recording": _recording(session)}
            parts["clock"] = _clock(session, last, self._mark)
        if self._doubles.found:
            values = parts["clock"].values if "clock" in parts else {}
            parts["clock"] = _Part(values, _WARN, self._doubles.found)
        return parts

    def _commands(self, session: SimulationSession | None) -> _Part:
        """Return the status of the commands: counts, a warning after refusals, an error after a failed callback."""
        counts: dict[str, object] = dict(self._refusals.counts())
        refused, faults = int(counts["commands refused"]) - self._refused, self._node.faults.count - self._faults
        self._refused, self._faults = self._refused + refused, self._faults + faults
        obeyed = _Part({}) if session is None else _judge_obedience(session)
        counts |= obeyed.values
        if faults > 0:
            return _Part(counts, _ERROR, f"a callback failed: {self._node.faults.last}")
        if refused > 0:
            return _Part(counts, _WARN, f"{refused} commands refused since the last report; the log says why")
        return _Part(counts, obeyed.level, obeyed.reason)


def _judge_obedience(session: SimulationSession) -> _Part:
    """Return the status of the reception and execution of commands.

    It warns if commands do not reach the node, if a command stops before its goal, or if a joint's effort is limited.
    """
    values: dict[str, object] = {f"{name} follows": leader for name, leader in session.inputs.list_leaders().items()}
    reason = "ok"
    if session.mode is ClockMode.LOCKSTEP and session.run.pace is not None:
        values["waits for"] = reason = f"waits for {session.waiting()}"
    if session.stepper.drive.slew.goals:
        values["on their way"] = _tell_approach(session)
    limited = _find_limited(session)
    if limited:
        values["joints"] = "; ".join(f"{name}: {text}" for name, text in limited.items())
    unheard = "; ".join(session.inputs.unheard())
    if unheard:
        values["unheard"] = unheard
        return _Part(values, _WARN, f"commands are not heard of {unheard}")
    if session.stepper.drive.slew.stopped:
        return _Part(values, _WARN, f"commands stay short of their goals: {values['on their way']}")
    if any("effort" in text for text in limited.values()):
        return _Part(values, _WARN, f"an arm is at its limits: {values['joints']}")
    return _Part(values, _OK, reason)


def _find_limited(session: SimulationSession) -> dict[str, str]:
    """Return a dict from joint name to a text, for joints whose motion or effort reached a limit in the last step."""
    last = session.run.last
    return {} if last is None else {name: joint.limited for name, joint in last.joints.items() if joint.limited}


def _tell_approach(session: SimulationSession) -> str:
    """Return a text about the commands that the rate limit delays: present values, goals, and the limit."""
    slew, present = session.stepper.drive.slew, session.simulation.commands
    goals = ", ".join(f"{name} at {present[name]:.4g} of {goal:.4g}" for name, goal in slew.goals.items())
    if slew.stopped:
        return f"{goals}; no further step converges within the deadline; remedy: smaller commands, or a longer deadline"
    if slew.share < 1.0:
        return f"{goals}; slowed down to {100.0 * slew.share:.3g} % of the range in slew_time, so that steps converge"
    return f"{goals}; at the range in slew_time"


def _work(session: SimulationSession) -> dict[str, object]:
    """Return the entry ``working on``; empty without long work.

    Long work is a task that takes longer than `_LONG`, or a request of ~/step.
    """
    stepper, request = session.stepper, session.step_request
    work, rounds = stepper.work, stepper.rounds
    if work is not None and (spent := time.monotonic() - work[1]) > _LONG:
        said = f"~/step: {request}; " if request is not None and request.going else ""
        return {"working on": f"{said}{work[0]}, for {spent:.1f} s, {rounds} rounds of iterations"}
    return {"working on": f"~/step: {request}"} if request is not None and request.going else {}


def _solver(session: SimulationSession, last: _Mark, mark: _Mark) -> _Part:
    steps = mark.steps - last.steps
    values: dict[str, object] = {"steps": mark.steps, "steps failed": session.stepper.failures}
    if steps > 0:
        values["solve time per step [ms]"] = f"{1e3 * (mark.solving - last.solving) / steps:.3f}"
        values["other time per step [ms]"] = f"{1e3 * (mark.other - last.other) / steps:.3f}"
    if session.run.last is None:
        return _Part(values, _OK, "no step yet")
    result = session.run.last.result
    values |= {
        "converged": result.converged,
        "iterations": result.iterations,
        "error estimate": f"{result.error_estimate:.3e}",
        "energy [J]": f"{result.energy:.6g}",
        **{f"energy: {name} [J]": f"{value:.6g}" for name, value in result.energies.items()},
        "least det F": f"{result.min_det:.4g}",
        "policy": result.policy.value,
        **{f"skipped: {name}": count for name, count in result.skipped.items()},
    }
    if result.converged or (result.cut_after is not None and session.has_arrived()):
        return _Part(values)
    return _Part(values, _WARN, f"not converged: {result.message or 'no step was solved there'}")


def _recording(session: SimulationSession) -> _Part:
    if session.bags.recorder is None:
        return _Part({}, _OK, "no bag")
    status = session.bags.recorder.status
    values = {
        "bag": session.bags.recorder.path,
        "messages written": status.written,
        "messages dropped": status.dropped_total,
        "bag error": status.error or "none",
    }
    if status.error is not None:
        return _Part(values, _ERROR, str(status.error))
    if status.dropped_total:
        return _Part(values, _WARN, f"{status.dropped_total} messages are not in the bag")
    return _Part(values, _OK, "recording" if session.bags.active else "finished")


def _clock(session: SimulationSession, last: _Mark, mark: _Mark) -> _Part:
    """Return the status of the clock; its rates are averages since the last report."""
    span, steps = max(mark.wall - last.wall, 1e-9), mark.steps - last.steps
    values: dict[str, object] = {
        "clock": "paused" if session.stepper.paused else session.mode.value,
        "simulation time [s]": f"{mark.simulation:.9g}",
        "real-time factor": f"{max(0.0, mark.simulation - last.simulation) / span:.4g}",
        "steps per second": f"{max(0, steps) / span:.4g}",
        **(figures := _figures(session, last, mark)),
        "overruns": mark.overruns,
    }
    if session.mode is ClockMode.EXTERNAL and session.run.pace is not None:
        values["behind the clock [s]"] = f"{session.run.pace.behind:.3f}"
    if (overruns := mark.overruns - last.overruns) > 0:
        listed = ", ".join(f"{name} {value}" for name, value in figures.items())
        text = f"{overruns} overruns since the last report: {listed}; simulation time falls behind"
        return _Part(values, _WARN, text)
    return _Part(values, _OK, str(values["clock"]))


def _figures(session: SimulationSession, last: _Mark, mark: _Mark) -> dict[str, str]:
    """Return texts with the requested rate [Hz], the achieved rate [Hz] and the delay per step [s].

    Under the wall clock, n steps with a total delay have the achieved rate n / (n / rate + delay): idle time does not
    reduce it.
    """
    steps, late, span = max(0, mark.steps - last.steps), mark.late - last.late, max(mark.wall - last.wall, 1e-9)
    rate, dt = session.run.parameters["rate"], session.run.parameters["dt"]
    if session.mode is not ClockMode.WALL:
        asked = {
            ClockMode.FAST: "as fast as possible",
            ClockMode.LOCKSTEP: "one step for each command set",
            ClockMode.EXTERNAL: f"{1.0 / dt:.4g} a second of /clock",
        }
        return _tell_pace(asked[session.mode], steps / span, late / max(steps, 1))
    work = session.stepper.work
    if work is not None and not steps:  # a step that takes longer than the report interval
        steps, late = 1, max(0.0, mark.wall - work[1] - 1.0 / rate)
    reached = rate if not steps else steps / (steps / rate + late)
    return _tell_pace(f"{rate:.4g}", reached, late / max(steps, 1))


def _tell_pace(asked: str, reached: float, late: float) -> dict[str, str]:
    return {"rate asked [Hz]": asked, "rate reached [Hz]": f"{reached:.4g}", "late per step [s]": f"{late:.4g}"}

# SPDX-License-Identifier: Apache-2.0
"""The thread that steps the simulation."""

from __future__ import annotations

import math
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Collection, Iterable
from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

import numpy as np

from gdfe_ros.checkpoint import save_state
from gdfe_ros.errors import CommandError, GdfeError, OverlapError
from gdfe_ros.node.driving.drive import CommandAssembler, Host
from gdfe_ros.node.driving.orders import Inbox, Order
from gdfe_ros.node.driving.pace import Pace, WallPace
from gdfe_ros.node.refusals import Reason, Refusal
from gdfe_ros.recording.step import Begin, Step, make_record, observe, to_nanoseconds
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.threads import STEPPER, show_name

_Value = TypeVar("_Value")


class StepFailure(GdfeError):
    """A step failed; the stepping is paused in the state before this step."""


_GRACE = 0.5
"""A request to end a solve has an effect once the solve has taken longer than this time [s]."""
_LONG = 0.1
"""Least duration of a long step [s]. The step before a long step, and the long step itself, are published even without
subscribers, so that the middleware can deliver them to late subscribers while the thread is busy.
"""
_MOST_RETRIES = 20
"""Largest number of successive steps without a new command that continue an unconverged solve. Steps that a deadline
ended are not counted.
"""


class SteppingThread:
    """Steps a simulation in a separate thread; only this thread uses the simulation while it runs.

    Args:
        run: owner of the simulation.
        deliver: function that receives each step; it may block to slow the stepping.
        store: function that publishes the last step even without subscribers; called once during a long step. None:
            steps are not published without subscribers.

    Attributes:
        changed: condition that wakes the thread; its lock guards the inbox.
        count: number of steps made.
        begin: kind of the state from which the next step starts.
        initial: whether the present state is the initial one, from which only a step of duration 0 was made.
        stepping: whether a step is being made.
        paused: whether only ``advance`` makes steps; set by `pause`.
        work: description of the present task, and its start on a monotonic clock [s]; None without a task.
        rounds: number of rounds of iterations of the solve in progress.
        drive: makes the command of each step from the orders.
        solving: wall time spent in solves so far [s].
        spent: wall time spent on steps so far, solves included [s].
        failure: why the last step failed and the stepping is paused; empty once the stepping is resumed.
        failures: number of failed steps.
    """

    def __init__(self, run: Host, *, deliver: Callable[[Step], None], store: Callable[[], None] | None = None) -> None:
        self._run, self._deliver, self._store = run, deliver, store
        self.drive = CommandAssembler(run)
        self.changed = threading.Condition()
        self.count = 0
        self.begin, self.initial = Begin.REST, False
        self.work: tuple[str, float] | None = None
        self.rounds = 0
        self._urgent: set[Future] = set()
        self.solving = self.spent = 0.0
        self.failure, self.failures = "", 0
        self._origin = 0
        self._jobs: deque[tuple[Callable[[], object], Future]] = deque()
        self._readings: deque[Callable[[], None]] = deque()
        self._retries, self._stored = 0, True
        self._rated = any(math.isfinite(actuator.rate) for actuator in run.scene.actuators)
        self.stepping = self._stopping = self._draining = self.paused = False
        self._thread: threading.Thread | None = None

    @property
    def _simulation(self) -> Simulation:
        return self._run.simulation

    @property
    def running(self) -> bool:
        """Whether the thread runs."""
        return self._thread is not None

    def start(self, pace: Pace, inbox: Inbox, *, paused: bool = False) -> None:
        """Start the thread: it delivers the present state at once, then makes a step whenever ``pace`` requires it.

        ``paused``: only ``advance`` makes steps.
        """
        self._pace, self._inbox = pace, inbox
        self._stopping, self.paused = False, paused
        self.failure = ""
        self._thread = threading.Thread(target=self._work, name=STEPPER, daemon=True)
        self._thread.start()

    def take_over(self, other: SteppingThread, bodies: Collection[str]) -> None:
        """Continue the commands and counts of another stepper; ``bodies`` are the names of all free bodies."""
        self.drive.take_over(other.drive, bodies)
        self._retries, self.count, self.rounds = other._retries, other.count, other.rounds
        self.solving, self.spent = other.solving, other.spent
        self.failure, self.failures = other.failure, other.failures

    def wake(self) -> None:
        """Make the thread check whether a step is due."""
        with self.changed:
            self.changed.notify_all()

    def stop(self, *, drain: bool = False) -> None:
        """End the thread after the step in progress; a long solve ends early. Without a thread, do nothing.

        ``drain``: first run the functions of `post` that still wait; without ``drain`` they are refused.
        """
        if self._thread is None:
            return
        with self.changed:
            self._stopping, self._draining = True, drain
            self.changed.notify_all()
        self._thread.join()
        self._thread = None

    def post(self, function: Callable[[], _Value], what: str = "", *, urgent: bool = False) -> Future[_Value]:
        """Queue a function to run between two steps; return a ``Future`` of its result. Without a thread, run it now.

        While the function runs, ``work`` contains its description ``what`` for diagnostics. An urgent function ends a
        solve in progress that takes longer than `_GRACE`.
        """
        future: Future = Future()
        if urgent:
            self._urgent.add(future)

        def tell_and_run() -> _Value:
            self._urgent.discard(future)
            self.work = (what, time.monotonic()) if what else None
            try:
                return function()
            finally:
                self.work = None

        if self._thread is None:
            _carry_out(tell_and_run, future)
            return future
        with self.changed:
            if self._stopping:
                future.set_exception(GdfeError("the stepping has ended"))
            else:
                self._jobs.append((tell_and_run, future))
                self.changed.notify_all()
        return future

    def post_reading(self, function: Callable[[], None]) -> None:
        """Queue a function that only reads and does not raise; it runs between two rounds of a solve, or two steps."""
        with self.changed:
            self._readings.append(function)
            self.changed.notify_all()

    def must_end(self) -> bool:
        """Return whether the solve in progress must end; the solver calls this after each round of iterations.

        It must end if the thread is to stop or an urgent function waits, and the step has taken longer than `_GRACE`.
        A call also runs the functions of `post_reading`. In a long step, one call publishes the last step (``store``).
        """
        self.rounds += 1
        while self._readings:
            self._readings.popleft()()
        if self._store is not None and not self._stored and time.monotonic() - self.work[1] > _LONG:
            self._stored = True
            self._store()
        return bool(self._stopping or self._urgent) and time.monotonic() - self.work[1] > _GRACE

    def pause(self, paused: bool) -> None:
        """Pause or resume the stepping."""
        with self.changed:
            self.paused = paused
            if not paused:
                self.failure = ""
                self._pace.restart()
            self.changed.notify_all()

    def advance(self) -> None:
        """Make one more step, regardless of pace and pause; it consumes the waiting orders. Called between steps.

        Raises:
            GdfeError: the step failed.
        """
        with self.changed:
            orders = self._inbox.remove_next()
            self._pace.restart()
        self._step(orders, dt=self._run.parameters["dt"])

    def reset(self) -> None:
        """Set the simulation to its initial state at time 0, drop orders, and deliver this state if the thread runs.

        Called between steps.
        """
        self._simulation.reset()
        self.restart(Begin.REST)

    def restart(self, begin: Begin) -> None:
        """Continue from a state that was changed from outside, and deliver it. Called between steps.

        Waiting orders, velocities and trajectories are dropped. ``begin`` is the kind of the state.
        """
        self.failure = ""
        self.drive.clear()
        self._origin = self._run.log_time - to_nanoseconds(self._simulation.time)
        if self._thread is not None:
            self._inbox.clear()
            self._pace.restart()
        self.repeat(begin)

    def repeat(self, begin: Begin) -> None:
        """Deliver the present state as an initial state of the kind ``begin``, if the thread runs.

        Called between steps, also after the run's simulation was replaced.
        """
        self.begin = begin
        if self._thread is not None:
            self._step((), dt=0.0, first=True)

    def begin_bag(self, write: Callable[[bytes | None], _Value]) -> _Value:
        """Begin a bag by ``write`` with the serialised state that the next step starts from; None: the initial state.

        Called between steps.
        """
        state = None if self.initial or self.begin is Begin.REST else save_state(self._simulation)
        made = write(state)
        if self.initial:
            self._simulation.reset()  # so that the next step repeats the first one
        self.begin = Begin.REST if state is None else Begin.LOADED
        return made

    def _work(self) -> None:
        show_name()
        action: Callable[[], None] | None = partial(self._step, (), dt=0.0, first=True)
        while action is not None:
            try:
                action()
            except StepFailure:
                pass  # it was reported, and the stepping is paused
            except Exception as error:
                self._hold("the work between steps", error)
            action = self._await()
        with self.changed:
            self._stopping = True
            while self._jobs:
                self._jobs.popleft()[1].set_exception(GdfeError("the stepping has ended"))

    def _await(self) -> Callable[[], None] | None:
        """Return the next task as `_next` does; if `_next` fails, pause the stepping and wait for posted functions."""
        try:
            return self._next()
        except Exception as error:
            self._hold("looking for the next step", error)
            return self._next()

    def _next(self) -> Callable[[], None] | None:
        """Wait for the next task and return it; None ends the thread."""
        with self.changed:
            while not self._stopping or (self._draining and self._jobs):
                if self._readings:
                    return self._readings.popleft()
                if self._jobs:
                    job = self._jobs.popleft()
                    return lambda: _carry_out(*job)
                delay = None
                if not self.paused:
                    pending = self._inbox.ready()
                    # An order makes a step due, whether the state is settled or not.
                    delay = self._pace.delay(pending=pending, settled=not pending and self._is_settled())
                if delay == 0.0:
                    return self._turn
                self.changed.wait(delay)
        return None

    def _turn(self) -> None:
        """Make the step that is due. With dynamics, an extra step first covers the idle time before new orders."""
        with self.changed:
            orders, dt = self._inbox.remove_next(), self._pace.begin()
        last = self._run.parameters["dt"]
        if orders and self._simulation.scene.dynamics and dt > 1.5 * last:
            self._step((), dt=dt - last, early=last)
            dt = last
        self._step(orders, dt=dt)

    def _hold(self, what: str, error: Exception) -> StepFailure:
        """Pause in the last good state after a failure, drop velocities and trajectories, and return the exception."""
        trace = "" if isinstance(error, GdfeError) else "".join(traceback.format_exception(error))
        self.failures += 1
        self.failure = f"{what} failed: {str(error) if isinstance(error, GdfeError) else repr(error)}"
        with self.changed:
            self.paused = True
        self.drive.clear()
        remedy = "~/pause false goes on, ~/reset goes back to rest"
        dropped = "the commands of this step, velocities and trajectories are dropped"
        text = f"{self.failure}; paused in the last good state, at {self._simulation.time:.9g} s, {dropped}; {remedy}"
        self._run.report(f"{text}\n{trace}".rstrip())
        return StepFailure(f"{self.failure}; paused in the last good state")

    def _is_settled(self) -> bool:
        """Return whether the state stays constant without a new order."""
        simulation = self._simulation
        states = simulation.actuator_states() if self._rated else {}
        rated = any(states[name].command != simulation.commands[name] for name in states)
        if self.drive.moving or rated:
            return False
        return simulation.settled or (not simulation.scene.dynamics and self._retries >= _MOST_RETRIES)

    def _step(self, orders: Iterable[Order], *, dt: float, first: bool = False, early: float = 0.0) -> None:
        """Make one step and deliver it; ``early`` [s] is the time from the step's end to the clock's present time.

        Raises:
            StepFailure: the step failed for any reason; the state before it is restored, and the stepping is paused.
        """
        before, text = self._simulation.snapshot(), f"step {self.count} to {self._simulation.time + dt:.9g} s"
        result = self._simulation.result
        self.stepping = True
        try:
            step = self._make(orders, dt=dt, first=first, early=early)
        except Exception as error:
            self.stepping, self.work = False, None
            self._simulation.restore(before)
            self._simulation.result = result
            raise self._hold(text, error) from error
        self.stepping = False
        self._deliver(step)

    def _make(self, orders: Iterable[Order], *, dt: float, first: bool, early: float) -> Step:
        """Make one step, and return its data."""
        started = time.perf_counter()
        run, simulation = self._run, self._simulation
        orders = tuple(orders)
        command = Command() if first else self._command(orders, dt)
        stamp, place = run.stamp(simulation.time + dt, early), run.parameters["cut_after"]
        limits = {"cut_after": place if place >= 0 else None, "deadline": run.parameters["deadline"] or None}
        self.work, self.rounds, self._stored = (f"a step to {simulation.time + dt:.9g} s", time.monotonic()), 0, False
        command, result = self._try_step(command, dt=dt, interrupted=self.must_end, **limits)
        self.work = None
        self.drive.slew.note(converged=result.converged, cut=result.cut_after is not None, iterations=result.iterations)
        if not np.isfinite(result.positions.sum()):  # equivalent to testing each value, in a fifth of the time
            raise GdfeError(f"step {self.count} gave positions that are not finite numbers: {result.message}")
        record = make_record(result, command, step=self.count, begin=self.begin, dt=dt, stamp=stamp)
        self._retries = 0 if orders or result.converged or record.cut else self._retries + 1
        log_time = self._origin + to_nanoseconds(result.time)
        stored = self._store is not None and result.wall_time > _LONG
        times = {"log_time": log_time, "first": first, "stored": stored}
        run.last = Step(record=record, result=result, **times, **observe(simulation))
        run.log_time = log_time
        self.initial = first and (self.begin is Begin.REST or (self.initial and self.begin is Begin.LAST))
        self.count, self.begin = self.count + 1, Begin.LAST
        self.solving += result.wall_time
        self.spent += time.perf_counter() - started
        return run.last

    def _try_step(self, command: Command, **given: Any) -> tuple[Command, StepResult]:
        """Make a step and return its command and result; leave out a refused teleport or a refused command."""
        step = self._simulation.step
        try:
            return command, step(command, **given)
        except OverlapError as error:
            self.drive.refuse(Command(bodies=command.bodies), Refusal(Reason.OVERLAP, str(error)))
            command = replace(command, bodies={})
        except CommandError as error:
            self.drive.refuse(command, Refusal(Reason.OUT_OF_RANGE, str(error)))
            self.drive.slew.clear()
            command = Command()
        return command, step(command, **given)

    def _command(self, orders: Iterable[Order], dt: float) -> Command:
        """Return the command of a step; under the wall clock or a deadline, actuator commands are limited."""
        values, acting = self._run.parameters, min(dt, self._run.parameters["dt"])
        hurried = isinstance(self._pace, WallPace) or values["deadline"] > 0.0
        slew_time = values["slew_time"] if hurried else 0.0
        return self.drive.command(orders, time=self._simulation.time + dt, dt=acting, slew_time=slew_time)


def _carry_out(function: Callable[[], object], future: Future) -> None:
    """Run a function and store its result or its exception in ``future``; nothing is raised in this thread."""
    try:
        future.set_result(function())
    except Exception as error:
        future.set_exception(error)

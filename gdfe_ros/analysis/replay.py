# SPDX-License-Identifier: Apache-2.0
"""Repetition of a recorded run, without ROS, and comparison with its published arrays."""

from __future__ import annotations

import dataclasses
import time
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from gdfe_ros.analysis.bag_run import RECORD, BagRun, BagStep, BagSteps
from gdfe_ros.analysis.difference import Difference, Differences
from gdfe_ros.analysis.message_values import Values, record_values
from gdfe_ros.checkpoint import load_state
from gdfe_ros.errors import GdfeError, RecordingError
from gdfe_ros.recording.message_tables import tables_of
from gdfe_ros.recording.provenance import STATE_FILE
from gdfe_ros.recording.step import OUTCOME, Begin, Step, StepRecord, observe
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene import scene_from_text
from gdfe_ros.simulation import Command, Simulation


@dataclass(frozen=True, eq=False)
class ReplayReport:
    """Result of a replay.

    Attributes:
        differences: differences between the bag (first run) and the replay (second run).
        unknown: topics of the bag that the replay does not reproduce; they are not compared.
        strays: dict from topic to the number of messages in the bag without a record of their step.
        cuts: number of recorded steps whose deadline passed; the replay ends their solves at the same check of the
            deadline. 0 with overrides.
        not_converged: number of other steps that did not converge in the replay.
        duration: simulation time that was replayed [s].
        wall_time: wall time of the replay, comparison included [s].
        inexact: number of commands that no message expresses exactly; only in a replay over topics.
        tail: dict from topic to the number of messages after the last step. They belong to a step whose record is
            missing at the end of the recording.
        end: last step and reason, if the replay ends before the bag does; empty if it is complete.
    """

    differences: Differences
    unknown: tuple[str, ...]
    strays: Counter[str]
    cuts: int
    not_converged: int
    duration: float
    wall_time: float
    inexact: int = 0
    tail: Counter[str] = field(default_factory=Counter)
    end: str = ""

    def verdict(self, factor: float = 0.0) -> Difference:
        """Return ``differences.verdict``, but INCOMPLETE if parts were not compared and the others agree."""
        verdict = self.differences.verdict(factor)
        incomplete = self.end or self.unknown or self.strays or not self.differences.compared
        return Difference.INCOMPLETE if incomplete and verdict is not Difference.DIFFERENT else verdict


class Replay:
    """Repeats the steps of a bag in a ``Simulation`` of its scene, with the commands that they consumed.

    Args:
        run: the recorded run.
        overrides: dict from dotted scene key to value. With overrides the runs differ. Solves that a deadline ended in
            the recorded run are then not ended early.

    Raises:
        RecordingError: the bag lacks data that a replay needs.
        SceneError: the overrides do not fit the scene.

    Attributes:
        scene: the recorded scene with the overrides.
        simulation: simulation of this scene.
        count: number of steps that can be replayed.
        end: last step and reason, if the replay ends before the bag does; empty if it is complete.

    Example:
        >>> report = Replay(BagRun("bags/bend5")).run()
        >>> report.verdict()
        <Difference.IDENTICAL: 'bit-identical'>
    """

    def __init__(self, run: BagRun, *, overrides: Mapping[str, Any] | None = None) -> None:
        self.count, self.end = replayable(run)
        self._run, self._changed = run, bool(overrides)
        origin = f"of bag {run.reader.path}"
        self.scene = scene_from_text(run.reader.run.scene, origin=origin, overrides=overrides)
        self.simulation, self._tables = Simulation(self.scene), tables_of(self.scene)
        self.begin()

    def begin(self) -> None:
        """Set the simulation to the initial state of the first step: the scene's state, or the state stored in the bag.

        Raises:
            RecordingError: the state belongs to another scene or version.
        """
        self.simulation.reset()
        if self._run.records[0].begin is not Begin.LOADED:
            return
        try:
            load_state(self.simulation, self._run.reader.run.files[STATE_FILE])
        except GdfeError as error:
            raise RecordingError(f"bag {self._run.reader.path} begins in the middle of a run; {error}") from error

    def run(self) -> ReplayReport:
        """Repeat and compare all steps before the first step whose initial state the bag does not determine."""
        started, steps = time.perf_counter(), BagSteps(self._run)
        repeated = (
            (step, self._publish(result, step.record, step.samples), result.converged)
            for step, result in self.steps(steps)
        )
        return compare_steps(steps, repeated, changed=self._changed, started=started, end=self.end)

    def steps(self, steps: BagSteps) -> Iterator[tuple[BagStep, StepResult]]:
        """Repeat the steps in order; yield each recorded step with the result of its repetition."""
        self.begin()
        for number, step in enumerate(steps, start=1):
            if step.record.begin is Begin.REST:
                self.simulation.reset()
            yield step, self._repeat(step.record)
            if self.end and number == self.count:
                return

    def _publish(self, result: StepResult, record: StepRecord, topics: Collection[str]) -> dict[str, Values]:
        """Return the arrays of the last step's messages, by topic and field, in their published types.

        Args:
            result: result of the last step.
            record: record of the recorded step that was repeated.
            topics: names without the node's name; topics for which the simulation has no arrays are left out.
        """
        step = Step(record=record, result=result, log_time=0, **observe(self.simulation))
        found = {topic: self._tables[topic].columns(step) for topic in topics if topic in self._tables}
        if RECORD in topics:
            outcomes = {name: getattr(result, name) for name in OUTCOME}
            begun = {"step": record.step, "begin": record.begin, "dt": record.dt, "stamp": record.stamp}
            found[RECORD] = record_values(StepRecord(**begun, time=result.time, **outcomes))
        return found

    def _repeat(self, record: StepRecord) -> StepResult:
        # A solve that a deadline ended can be ended at the same iteration only if the scene is the same.
        cut_after = None if self._changed else record.cut_after
        # A run that can be interrupted asks between iterations whether to go on, which may change a step that fails.
        return self.simulation.step(command_of(record), dt=record.dt, cut_after=cut_after, interrupted=lambda: False)


def compare_steps(
    steps: BagSteps,
    repeated: Iterable[tuple[BagStep, Mapping[str, Values], bool]],
    *,
    changed: bool,
    started: float,
    **more: Any,
) -> ReplayReport:
    """Compare recorded steps with their repetitions and return the report.

    Args:
        steps: the recorded steps.
        repeated: each recorded step, the arrays of its repetition by topic and field, and whether the repetition
            converged.
        changed: whether overrides make the runs differ; solves that a deadline ended in the recorded run are then not
            ended early.
        started: when the replay began, on the clock ``time.perf_counter`` [s].
        more: other attributes of the report.
    """
    differences, records = Differences(steps.run.scene), []
    unknown, failed = set(steps.foreign), 0
    for step, found, converged in repeated:
        unknown |= step.samples.keys() - found.keys()
        known = {topic: values for topic, values in step.samples.items() if topic in found}
        differences.add(step.key, known, {topic: found[topic] for topic in known})
        failed += not converged and not step.record.cut
        records.append(step.record)
    return ReplayReport(
        differences,
        tuple(sorted(unknown)),
        steps.strays.copy(),
        0 if changed else sum(record.cut_after is not None for record in records),
        failed,
        sum(record.dt for record in records),
        time.perf_counter() - started,
        tail=steps.tail.copy(),
        **more,
    )


def command_of(record: StepRecord) -> Command:
    """Return the command that a step consumed; the attributes of both have the same names."""
    return Command(**{part.name: getattr(record, part.name) for part in dataclasses.fields(Command)})


def replayable(run: BagRun) -> tuple[int, str]:
    """Return the number of steps that can be replayed, and the reason why the next step cannot.

    Returns:
        Number of replayable steps from the start, and the reason; the reason is empty if all steps can be replayed.

    Raises:
        RecordingError: the bag has no steps, or lacks the initial state of the first step.
    """
    bag, records = run.reader.path, run.records
    if not records:
        raise RecordingError(f"bag {bag} holds no step: there is nothing to replay")
    first = records[0]
    stored = first.begin is Begin.LOADED and STATE_FILE in run.reader.run.files
    if first.begin is not Begin.REST and not stored:
        raise RecordingError(
            f"bag {bag} begins with step {first.step}, which continued from a state that the bag does not hold; "
            "remedy: record from the activation or a reset on"
        )
    for count, (before, after) in enumerate(pairwise(records), start=1):
        reason = _gap(before, after)
        if reason:
            where = f"the replay ends with step {before.step}, t = {before.time:.9g} s, {count} of {len(records)} steps"
            return count, f"{where}: {reason}"
    return len(records), ""


def _gap(before: StepRecord, after: StepRecord) -> str:
    """Return the reason why step ``after`` does not continue from ``before``; empty if it can be replayed."""
    if after.begin is Begin.LOADED:
        return f"step {after.step} continued from a state that was loaded from a file, which the bag does not hold"
    if after.step != before.step + 1 and after.begin is not Begin.REST:
        return (
            f"the records of the steps {before.step + 1} to {after.step - 1} were dropped or lost, and later states "
            "depend on them; gdfe compare and gdfe report read what comes after"
        )
    return ""

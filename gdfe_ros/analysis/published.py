# SPDX-License-Identifier: Apache-2.0
"""The arrays that the node would publish for the present state of a simulation, made without ROS."""

from __future__ import annotations

from collections.abc import Collection

from gdfe_ros.analysis.bag_run import RECORD
from gdfe_ros.analysis.message_values import Values, record_values
from gdfe_ros.recording.published import tables_of
from gdfe_ros.recording.step import OUTCOME, Demand, Step, observe
from gdfe_ros.recording.step_record import StepRecord
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.result import StepResult


class Publication:
    """Makes the arrays of each step's messages, in their published types.

    Args:
        simulation: the stepped simulation.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation, self._tables = simulation, tables_of(simulation.scene)

    def values(self, result: StepResult, record: StepRecord, topics: Collection[str]) -> dict[str, Values]:
        """Return the arrays of the last step's messages, by topic and field.

        Args:
            result: result of the last step.
            record: record of the recorded step that was repeated.
            topics: names without the node's name; topics for which the simulation has no arrays are left out.
        """
        step = Step(record=record, result=result, log_time=0, **observe(self._simulation, Demand()))
        found = {topic: self._tables[topic].columns(step) for topic in topics if topic in self._tables}
        if RECORD in topics:
            outcomes = {name: getattr(result, name) for name in OUTCOME}
            begun = {"step": record.step, "begin": record.begin, "dt": record.dt}
            found[RECORD] = record_values(StepRecord(**begun, time=result.time, **outcomes))
        return found

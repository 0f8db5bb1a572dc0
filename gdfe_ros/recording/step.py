# SPDX-License-Identifier: Apache-2.0
"""The data of a step that pass from the solver to the topics."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

from gdfe_ros.actuators import ActuatorState
from gdfe_ros.arms.carriers import JointReading
from gdfe_ros.arms.dynamics import LinkFrame
from gdfe_ros.constraints import Pose
from gdfe_ros.element_fields import ElementFields
from gdfe_ros.recording.step_record import Begin, StepRecord
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.solver.motion.imu import ImuReading
from gdfe_ros.solver.result import StepResult

OUTCOME = (
    "converged", "iterations", "substeps", "error_estimate", "energy", "min_det", "wall_time", "skipped", "message",
    "cut_after", "energies",
)  # fmt: skip
"""Attributes of a result that its record has, too."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Step:
    """All data of one step that are published; what takes time is evaluated once, when a message needs it.

    Attributes:
        record: record of the step's input and outcome.
        result: result of the simulation's step.
        log_time: log time in the bag [ns]: simulation time, continued after a reset so that it never goes back.
        first: whether the step only delivers a state, e.g. after an activation or a reset. Such a state is published
            even without subscribers, because a subscriber that is discovered later receives it.
        again: whether the step was published before and is repeated for new subscribers.
        stored: whether it is published without subscribers, too: the middleware stores it for later ones, who would
            else first receive an older state and wait for a long solve.
        fields: function that evaluates the element fields.
        find_poses: function that evaluates the poses of handles, obstacles and rigid bodies.
        actuators: states of the actuators, by name.
        joints: states of the joints of arms, by name.
        links: frames of the links of arms, by name.
        imus: function that evaluates the readings of inertial measurement units; without dynamics there are none.
    """

    record: StepRecord
    result: StepResult
    log_time: int
    first: bool = False
    again: bool = False
    stored: bool = False
    fields: Callable[[], ElementFields]
    find_poses: Callable[[], Mapping[str, Pose]]
    actuators: Mapping[str, ActuatorState]
    joints: Mapping[str, JointReading]
    links: Mapping[str, LinkFrame]
    imus: Callable[[], Mapping[str, ImuReading]]

    @property
    def poses(self) -> Mapping[str, Pose]:
        """Pose of each handle, obstacle and rigid body, by name."""
        return self.find_poses()


def to_nanoseconds(seconds: float) -> int:
    """Return a time [s] rounded to nanoseconds."""
    return round(seconds * 1e9)


def make_record(result: StepResult, command: Command, *, step: int, begin: Begin, dt: float, stamp: int) -> StepRecord:
    """Return the record of a step: the command that it consumed and its outcome."""
    return StepRecord(
        step=step,
        begin=begin,
        time=result.time,
        dt=dt,
        stamp=stamp,
        **vars(command),
        cut=result.cut_after is not None and not result.converged,
        **{name: getattr(result, name) for name in OUTCOME},
    )


def observe(simulation: Simulation) -> dict[str, object]:
    """Return the outputs of the present state, as keyword arguments of ``Step``."""
    return {
        "fields": cache(simulation.later_fields()),
        "find_poses": cache(simulation.later_poses()),
        "actuators": simulation.actuator_states(),
        "joints": simulation.joint_states(),
        "links": simulation.link_frames(),
        "imus": cache(simulation.later_imus()) if simulation.scene.dynamics else dict,
    }

# SPDX-License-Identifier: Apache-2.0
"""The data of a step that pass from the solver to the topics."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache

from gdfe_ros.actuators import ActuatorState
from gdfe_ros.arms.carriers import JointReading
from gdfe_ros.arms.dynamics import LinkFrame
from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.obstacle import Obstacle
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


@dataclass(frozen=True, kw_only=True)
class Demand:
    """The outputs of a step that a subscriber or a bag needs; by default all.

    Attributes:
        messages: whether any message is needed.
        fields: whether element fields are needed.
        poses: whether poses of handles and obstacles are needed.
        actuators: whether states of actuators and joints are needed.
        imus: whether readings of inertial measurement units are needed.
    """

    messages: bool = True
    fields: bool = True
    poses: bool = True
    actuators: bool = True
    imus: bool = True


@dataclass(frozen=True, eq=False, kw_only=True)
class Step:
    """All data of one step that are published.

    Attributes:
        record: record of the step's input and outcome.
        result: result of the simulation's step.
        log_time: log time in the bag [ns]: simulation time, continued after a reset so that it never goes back.
        first: whether the step only delivers a state, e.g. after an activation or a reset. Such a state is published
            even without subscribers, because a subscriber that is discovered later receives it.
        again: whether the step was published before and is repeated for new subscribers.
        stored: whether it is published without subscribers, too: the middleware stores it for later ones, who would
            else first receive an older state and wait for a long solve.
        wanted: whether a subscriber or a bag needs any part of the step.
        fields: function that evaluates the element fields, once, in the publishing thread; None if they are not needed.
        obstacles: pose of each obstacle; always given, because commands may be in the obstacles' frames.
        poses: pose of each handle and obstacle; empty if poses are not needed.
        actuators: states of the actuators, by name; empty if they are not needed.
        joints: states of the joints of arms, by name; always given, because diagnostics report their limits.
        links: frames of the links of arms, by name; empty if poses are not needed.
        imus: function that evaluates the readings of inertial measurement units in the publishing thread; None if they
            are not needed, or without dynamics.
    """

    record: StepRecord
    result: StepResult
    log_time: int
    first: bool = False
    again: bool = False
    stored: bool = False
    wanted: bool = True
    fields: Callable[[], ElementFields] | None = None
    obstacles: Mapping[str, Pose] = field(default_factory=dict)
    poses: Mapping[str, Pose] = field(default_factory=dict)
    actuators: Mapping[str, ActuatorState] = field(default_factory=dict)
    joints: Mapping[str, JointReading] = field(default_factory=dict)
    links: Mapping[str, LinkFrame] = field(default_factory=dict)
    imus: Callable[[], Mapping[str, ImuReading]] | None = None


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
        handles=command.handles,
        actuators=command.actuators,
        loads=command.loads,
        bodies=command.bodies,
        joints=command.joints,
        cut=result.cut_after is not None and not result.converged,
        **{name: getattr(result, name) for name in OUTCOME},
    )


def observe(simulation: Simulation, demand: Demand) -> dict[str, object]:
    """Return the outputs of the present state that ``demand`` contains, as keyword arguments of ``Step``."""
    imus = demand.imus and simulation.scene.dynamics is not None
    obstacles = [handle.name for handle in simulation.scene.handles if isinstance(handle, Obstacle)]
    return {
        "wanted": demand.messages,
        "obstacles": {name: simulation.handle_pose(name) for name in obstacles},
        "fields": cache(simulation.later_fields()) if demand.fields else None,
        "poses": {name: simulation.handle_pose(name) for name in simulation.handle_names if demand.poses},
        "actuators": simulation.actuator_states() if demand.actuators else {},
        "joints": simulation.joint_states(),
        "links": simulation.link_frames() if demand.poses else {},
        "imus": cache(simulation.later_imus()) if imus else None,
    }

# SPDX-License-Identifier: Apache-2.0
"""A step on its way from the solver to the topics."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.actuators import ActuatorState
from gdfe_ros.constraints import Axis, Handle, Pose
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.recording.step_record import Begin, StepRecord
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.solver.elements.fields import ElementFields
from gdfe_ros.solver.motion.imu import ImuReading
from gdfe_ros.solver.result import StepResult

_OUTCOME = (
    "converged", "iterations", "substeps", "residual", "energy", "min_det", "wall_time", "skipped", "message",
    "cut_after", "energies",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Demand:
    """What somebody wants of a step beyond its result; the default is all.

    Attributes:
        messages: any message at all.
        fields: element fields.
        poses: of handles and obstacles.
        actuators: their states.
        imus: what inertial units read.
    """

    messages: bool = True
    fields: bool = True
    poses: bool = True
    actuators: bool = True
    imus: bool = True


@dataclass(frozen=True, eq=False, kw_only=True)
class Step:
    """All that is published of one step.

    Attributes:
        record: input and outcome.
        result: of the simulation.
        log_time: simulation time that never goes back, for the bag [ns].
        first: the state that the node was activated with or reset to: published whether anybody listens or not,
            so that a subscriber that is still being discovered gets it, too.
        again: told before; for those that have begun to listen since.
        wanted: whether anything of it is to be published or recorded.
        fields: evaluates the element fields, in the thread that publishes; None where nobody wants them.
        obstacles: where each is, whether anybody wants it or not: commands may be given in their frames.
        poses: where each handle and obstacle is; empty where nobody wants it, like the following.
        actuators: states by name.
        imus: evaluates what inertial units read, in the thread that publishes; None where nobody wants it, and without
            dynamics.
    """

    record: StepRecord
    result: StepResult
    log_time: int
    first: bool = False
    again: bool = False
    wanted: bool = True
    fields: Callable[[], ElementFields] | None = None
    obstacles: Mapping[str, Pose] = field(default_factory=dict)
    poses: Mapping[str, Pose] = field(default_factory=dict)
    actuators: Mapping[str, ActuatorState] = field(default_factory=dict)
    imus: Callable[[], Mapping[str, ImuReading]] | None = None


def to_nanoseconds(seconds: float) -> int:
    """Round a time [s] to nanoseconds."""
    return round(seconds * 1e9)


def make_record(result: StepResult, command: Command, *, step: int, begin: Begin, dt: float, stamp: int) -> StepRecord:
    """Write down what a step consumed and how it went."""
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
        cut=result.cut_after is not None and not result.converged,
        **{name: getattr(result, name) for name in _OUTCOME},
    )


def observe(simulation: Simulation, demand: Demand) -> dict[str, object]:
    """Evaluate what is wanted of the present state, as keywords of ``Step``."""
    imus = demand.imus and simulation.scene.dynamics is not None
    obstacles = [handle.name for handle in simulation.scene.handles if isinstance(handle, Obstacle)]
    return {
        "wanted": demand.messages,
        "obstacles": {name: simulation.handle_pose(name) for name in obstacles},
        "fields": simulation.later_fields() if demand.fields else None,
        "poses": {name: simulation.handle_pose(name) for name in simulation.handle_names if demand.poses},
        "actuators": simulation.actuator_states() if demand.actuators else {},
        "imus": simulation.later_imus() if imus else None,
    }


def handle_error(handle: Handle, target: Pose, rest: NDArray[np.float64], positions: NDArray[np.float64]) -> float:
    """Give how far a handle is from its target along the axes that it has not free [m]; vertices are all (n, 3) [m].

    An obstacle is always where it is commanded to be.
    """
    if isinstance(handle, Obstacle):
        return 0.0
    before, now = rest[handle.vertices], positions[handle.vertices]
    centre = before.mean(axis=0)
    wanted = Rotation.from_rotvec(target.rotation).apply(before - centre) + centre + target.translation
    error = np.abs((now - wanted).mean(axis=0) if handle.turning else now - wanted)
    held = [place for place, axis in enumerate(Axis) if axis not in handle.free]
    return float(error[..., held].max(initial=0.0))

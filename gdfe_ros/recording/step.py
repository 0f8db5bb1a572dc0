# SPDX-License-Identifier: Apache-2.0
"""The data of a step that pass from the solver to the topics, and its record on ``~/step_record``.

The record has all inputs that a replay needs to repeat the step. It is JSON text. Numbers are exact, because Python
writes a float as a text that reads back as the same double.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cache
from typing import TYPE_CHECKING, Any

from gdfe_ros.constraints import Pose
from gdfe_ros.errors import RecordingError
from gdfe_ros.untrusted.bounded_text import load_json_object
from gdfe_ros.untrusted.real_number import is_finite, is_number

if TYPE_CHECKING:
    from gdfe_ros.actuators import ActuatorState
    from gdfe_ros.arms.carriers import JointReading
    from gdfe_ros.arms.dynamics import LinkFrame
    from gdfe_ros.results.element_fields import ElementFields
    from gdfe_ros.results.inertial_units import ImuReading
    from gdfe_ros.results.step_result import StepResult
    from gdfe_ros.simulation import Command, Simulation

FORMAT = 1
_LARGEST = 4_000_000
"""Largest number of characters of a record."""
_LONGEST_STEP = 1e9
"""Largest duration of a step [s]."""

ENERGIES = {"kinetic", "elastic", "potential", "work", "dissipated"}
"""Names of the energies that the record of a step with dynamics must have; it may have more."""


class Begin(str, Enum):
    """The state from which a step starts."""

    REST = "rest"
    LAST = "last"
    LOADED = "loaded"


@dataclass(frozen=True, kw_only=True)
class StepRecord:
    """Input and outcome of one step.

    A replay starts from the state ``begin`` and calls ``Simulation.step`` with ``handles``, ``actuators``, ``loads``,
    ``bodies``, ``joints``, ``dt`` and ``cut_after``. With ``cut_after`` a solve ends where the deadline ended it in the
    recorded run.

    Attributes:
        step: number of the step since the node was configured; 0 is the state at activation.
        begin: state from which the step starts: the last step's state, the initial state, or a loaded state.
        time: simulation time at the end of the step [s].
        dt: duration of the step [s].
        stamp: stamp of the step's messages on the node's clock [ns].
        handles: dict from handle to the target that this step consumed: translation [m] and rotation vector [rad].
        actuators: dict from actuator to the command that this step consumed, in the unit of the mode.
        loads: dict from load to the factor that this step consumed.
        bodies: dict from free body to the pose to which it was teleported before this step, in the form of ``handles``;
            the JSON text lacks an empty entry.
        joints: dict from joint to the commanded position that this step consumed [rad] or [m]; the JSON text lacks the
            entry if it is empty.
        cut: whether a deadline ended the solve before it had converged.
        cut_after: number of the solve's checks of its deadline before the deadline passed; None if it did not pass.
        converged: whether the solve converged. ``StepResult`` has this attribute and all following ones, too.
        iterations: number of linear solves.
        substeps: number of increments.
        error_estimate: estimated distance to the equilibrium, divided by the body's size; infinite if it is unknown
            because a deadline ended the solve.
        energy: strain energy [J].
        min_det: smallest det F.
        wall_time: time spent on the solve [s]; the only entry that differs between two equal runs.
        skipped: dict from a kind of work to the number of times that it was left out.
        message: description of the defect; empty if there is none.
        energies: dict from name to energy of a body in motion [J]. Without dynamics it is empty, and the JSON text
            lacks the entry.
    """

    step: int
    begin: Begin
    time: float
    dt: float
    stamp: int
    handles: Mapping[str, Pose] = field(default_factory=dict)
    actuators: Mapping[str, float] = field(default_factory=dict)
    loads: Mapping[str, float] = field(default_factory=dict)
    bodies: Mapping[str, Pose] = field(default_factory=dict)
    joints: Mapping[str, float] = field(default_factory=dict)
    cut: bool = False
    cut_after: int | None = None
    converged: bool = True
    iterations: int = 0
    substeps: int = 0
    error_estimate: float = 0.0
    energy: float = 0.0
    min_det: float = 1.0
    wall_time: float = 0.0
    skipped: Mapping[str, int] = field(default_factory=dict)
    message: str = ""
    energies: Mapping[str, float] = field(default_factory=dict)

    def to_json(self) -> str:
        """Return the published text: one JSON object, with ``format`` as first entry and poses as six numbers."""
        entries = {name: getattr(self, name) for name in self.__dataclass_fields__}
        for poses in ("handles", "bodies"):
            entries[poses] = {name: [*pose.translation, *pose.rotation] for name, pose in entries[poses].items()}
        for seldom in ("bodies", "joints", "energies"):
            if not entries[seldom]:
                del entries[seldom]
        # JSON has no infinity: an unknown distance is null.
        entries["error_estimate"] = self.error_estimate if math.isfinite(self.error_estimate) else None
        return json.dumps({"format": FORMAT, **entries, "begin": self.begin.value})

    @classmethod
    def from_json(cls, text: str) -> StepRecord:
        """Return the record from its JSON text.

        Raises:
            RecordingError: the text is not that of a step record, or has another format.
        """
        try:
            entries = load_json_object(text, largest=_LARGEST)
            if entries.pop("format") != FORMAT:
                raise ValueError(f"its format is not {FORMAT}")
            entries["begin"] = Begin(entries["begin"])
            _require_sound(entries)
            if entries["error_estimate"] is None:
                entries["error_estimate"] = math.inf
            for poses in entries.keys() & {"handles", "bodies"}:
                found = entries[poses].items()
                entries[poses] = {name: Pose(tuple(six[:3]), tuple(six[3:])) for name, six in found}
            return cls(**entries)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise RecordingError(
                f"step record {text[:80]!r} cannot be read: {error!r}; it must come from this version's node"
            ) from error


def _require_sound(entries: dict[str, Any]) -> None:
    """Raise a ValueError if a value has a type or range with which the step cannot be repeated.

    A pose must be six finite numbers, a command one finite number, and the duration of a step is limited.
    """
    for section, count in (("handles", 6), ("bodies", 6), ("actuators", 0), ("loads", 0), ("joints", 0)):
        given = entries.get(section, {})
        if not isinstance(given, dict):
            raise ValueError(f"its {section} are no object")
        for name, value in given.items():
            numbers = value if count else [value]
            if not isinstance(numbers, list) or len(numbers) != (count or 1) or not all(map(_is_finite, numbers)):
                raise ValueError(f"the value of {name[:80]!r} in its {section} is not {count or 'a'} finite number(s)")
    _require_numbers(entries.get("skipped", {}), "skipped work", set())
    _require_numbers(entries.get("energies", {}), "energies", ENERGIES)
    for name, least, most in (("dt", 0.0, _LONGEST_STEP), ("time", -math.inf, math.inf)):
        value = entries[name]
        if not _is_finite(value) or not least <= value <= most:
            raise ValueError(f"its {name} is {value!r}; allowed: {least:g} to {most:g} s")
    for name in ("step", "stamp", "cut_after"):
        value = entries[name]
        if not (_is_whole(value) or (name == "cut_after" and value is None)):
            raise ValueError(f"its {name} is {str(value)[:80]}; allowed: an integer")


def _is_whole(value: object) -> bool:
    return is_number(value, int) and abs(value) < 2**63


def _require_numbers(given: object, noun: str, names: set[str]) -> None:
    """Raise a ValueError unless ``given`` maps names to numbers, and is empty or has all of ``names``."""
    if not isinstance(given, dict) or not all(isinstance(value, int | float) for value in given.values()):
        raise ValueError(f"its {noun} are no numbers by name")
    if given and (missing := names - given.keys()):
        raise ValueError(f"its {noun} lack {', '.join(sorted(missing))}")


def _is_finite(value: object) -> bool:
    return is_number(value) and is_finite(value)


OUTCOME = (
    "converged", "iterations", "substeps", "error_estimate", "energy", "min_det", "wall_time", "skipped", "message",
    "cut_after", "energies",
)  # fmt: skip
"""Attributes that `StepResult` and `StepRecord` have in common."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Step:
    """All published data of one step; costly data are evaluated once, when a message needs them.

    Attributes:
        record: record of the step's input and outcome.
        result: result of the simulation's step.
        log_time: log time in the bag [ns]: simulation time, continued after a reset so that it never goes back.
        first: whether the step only delivers a state, e.g. after an activation or a reset. Such a state is published
            even without subscribers, because a subscriber that is discovered later receives it.
        again: whether the step was published before and is repeated for new subscribers.
        stored: whether the step is published even without subscribers, so that the middleware stores it for later ones.
            They would otherwise first receive an older state, and wait for the end of a long solve.
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

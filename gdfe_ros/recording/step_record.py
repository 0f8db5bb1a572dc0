# SPDX-License-Identifier: Apache-2.0
"""The record of one step on ``~/step_record``: all inputs that a replay needs to repeat the step.

It is JSON text: Python writes a float as the shortest text that reads back as the same double, so nothing is lost.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from gdfe_ros.constraints import Pose
from gdfe_ros.errors import RecordingError

FORMAT = 1


class Begin(str, Enum):
    """The state from which a step starts."""

    REST = "rest"
    LAST = "last"
    LOADED = "loaded"


@dataclass(frozen=True, kw_only=True)
class StepRecord:
    """Input and outcome of one step.

    A replay starts from ``begin`` and calls ``Simulation.step`` with ``handles``, ``actuators``, ``loads``, ``bodies``,
    ``joints``, ``dt`` and ``cut_after``. The last one ends a solve at the same place as its deadline did.

    Attributes:
        step: number of the step since the node was configured; 0 is the state at activation.
        begin: initial state of the step: that of the last step, the rest shape after a reset, or a loaded state.
        time: simulation time at the end of the step [s].
        dt: duration of the step [s].
        stamp: stamp of the step's messages on the node's clock [ns]; None in old bags, where it is the simulation time.
        handles: targets consumed by this step, by handle: translation [m] and rotation vector [rad].
        actuators: commands consumed by this step, by actuator, in the unit of its mode.
        loads: factors of loads consumed by this step, by load.
        bodies: poses to which rigid bodies were teleported before this step, as for handles; the text lacks the entry
            if there are none.
        joints: commanded positions of joints of arms consumed by this step, by joint [rad] or [m]; the text lacks the
            entry if there are none.
        cut: whether a deadline ended the solve before it had converged.
        cut_after: number of the solve's checks of its deadline before the deadline passed; None if it did not pass.
        converged: as in ``StepResult``, like all following attributes.
        iterations: linear solves.
        substeps: increments.
        error_estimate: estimated distance to the equilibrium over the body's size; infinite for a solve that was cut.
        energy: strain energy [J].
        min_det: least det F.
        wall_time: time spent solving [s]; the only entry that differs between two equal runs.
        skipped: counts of work that was left out, by name.
        message: the defect; empty if there is none.
        energies: energies of a body in motion [J], by name. Without dynamics it is empty, and the text lacks the entry.
    """

    step: int
    begin: Begin
    time: float
    dt: float
    stamp: int | None = None
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
        """Return the published text: one object, ``format`` first, poses as six numbers."""
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
        """Return the record that ``to_json`` wrote.

        Raises:
            RecordingError: not such a text, or of another format.
        """
        try:
            entries = json.loads(text)
            if entries.pop("format") != FORMAT:
                raise ValueError(f"its format is not {FORMAT}")
            entries["begin"] = Begin(entries["begin"])
            if "residual" in entries:  # its name in older bags
                entries["error_estimate"] = entries.pop("residual")
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

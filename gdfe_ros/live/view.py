# SPDX-License-Identifier: Apache-2.0
"""The data of a step that a page shows; the step is from this process or from a node."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.contacts import contact_points
from gdfe_ros.recording.step_record import StepRecord

if TYPE_CHECKING:
    from gdfe_ros.recording.step import Step

Reading = tuple[str, float, str]
"""Name of a quantity, its value and its unit."""


@dataclass(frozen=True, eq=False, kw_only=True)
class View:
    """The data of a step that a page shows.

    Attributes:
        record: record of the step's input and outcome.
        positions: positions of the vertices (n, 3) [m].
        velocities: velocities of the vertices (n, 3) [m/s]; None without dynamics.
        fields: function that returns the fields of the cells (m,) by name; they are evaluated in the caller's thread.
        poses: poses of handles, obstacles and rigid bodies by name, relative to rest.
        wrenches: dict from handle, obstacle or rigid body to its wrench on the body (6,), force [N] then moment [N m].
        contacts: function that returns the contact points (k,), as `gdfe_ros.contacts.POINT`.
        actuators: dict from actuator to its readings.
        joints: dict from joint of an arm to its position [rad] or [m].
    """

    record: StepRecord
    positions: NDArray[np.floating]
    velocities: NDArray[np.floating] | None
    fields: Callable[[], Mapping[str, NDArray[np.floating]]]
    poses: Mapping[str, Pose]
    wrenches: Mapping[str, NDArray[np.float64]]
    contacts: Callable[[], NDArray[np.void]]
    actuators: Mapping[str, list[Reading]]
    joints: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, step: Step) -> View:
        """Return the view of a step of this process; expensive parts are evaluated only when the view is drawn."""
        result = step.result
        return cls(
            record=step.record,
            positions=result.positions,
            velocities=result.velocities,
            fields=lambda: vars(step.fields()),
            poses=step.poses,
            wrenches=result.reactions,
            contacts=lambda: contact_points(result.contacts),
            actuators={name: state.readings() for name, state in step.actuators.items()},
            joints={name: state.position for name, state in step.joints.items()},
        )

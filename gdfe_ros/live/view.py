# SPDX-License-Identifier: Apache-2.0
"""All that a page shows of a step, wherever that was made."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.contacts import contact_points
from gdfe_ros.recording.step_record import StepRecord

if TYPE_CHECKING:
    from gdfe_ros.node.step import Step

Reading = tuple[str, float, str]
"""A quantity, its value and its unit."""


@dataclass(frozen=True, eq=False, kw_only=True)
class View:
    """A step, as it is shown.

    Attributes:
        record: input and outcome.
        positions: (n, 3) of the vertices [m].
        velocities: (n, 3) [m/s]; None without dynamics.
        fields: gives the fields of the cells (m,) by name, evaluated where it is called.
        poses: of handles, obstacles and rigid bodies, relative to rest.
        wrenches: that these exert on the body (6,), force [N] then moment [N m].
        contacts: gives what touches (k,), as `gdfe_ros.contacts.POINT`.
        actuators: what each reports.
    """

    record: StepRecord
    positions: NDArray[np.floating]
    velocities: NDArray[np.floating] | None
    fields: Callable[[], Mapping[str, NDArray[np.floating]]]
    poses: Mapping[str, Pose]
    wrenches: Mapping[str, NDArray[np.float64]]
    contacts: Callable[[], NDArray[np.void]]
    actuators: Mapping[str, list[Reading]]

    @classmethod
    def of(cls, step: Step) -> View:
        """Show a step of this process; what costs time is evaluated when it is drawn."""
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
        )

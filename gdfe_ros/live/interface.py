# SPDX-License-Identifier: Apache-2.0
"""Interface between the page and a run, and the data of a step that the page shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.node.driving.orders import Order
from gdfe_ros.recording.step import StepRecord
from gdfe_ros.results.contacts import contact_points
from gdfe_ros.scene.scene import Scene

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
        contacts: function that returns the contact points (k,), as `gdfe_ros.results.contacts.POINT`.
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


class Ability(str, Enum):
    """Request to a run that is not a command; the page has a button for each request."""

    PLAY = "play the program"
    PAUSE = "pause"
    STEP = "one step"
    RESET = "reset"
    RECORD = "record"
    MODULI = "change the body"


class ShownRun(Protocol):
    """A run that is drawn and commanded.

    Attributes:
        failure: exception that ended the run; None if there was none.
    """

    failure: Exception | None = None

    @property
    def abilities(self) -> frozenset[Ability]:
        """Supported requests: all, but playback only if the scene has a program."""
        return frozenset(Ability) - ({Ability.PLAY} if self.scene.program is None else frozenset())

    @property
    def title(self) -> str:
        """Title of the page."""

    @property
    def scene(self) -> Scene:
        """The scene of the simulation."""

    @property
    def commands(self) -> Mapping[str, float]:
        """Present commands of actuators, loads and joints, by name; unknown commands are left out."""

    @property
    def targets(self) -> Mapping[str, Pose]:
        """Present targets of handles and obstacles by name, relative to rest."""

    @property
    def moduli(self) -> Mapping[str, float]:
        """Present Young's moduli [Pa] by material, of the materials with such a modulus."""

    @property
    def paused(self) -> bool:
        """Whether steps are made only on request."""

    @property
    def recording(self) -> str | None:
        """Path of the bag that is being written, or None."""

    def watch(self, wanted: bool) -> None:
        """Inform the run whether there are viewers; by default, do nothing."""

    def doing(self) -> tuple[str, bool]:
        """Return a text about the run's activity, and whether it is a problem; empty while it only makes steps."""

    def command(self, name: str, order: Order) -> None:
        """Queue an order for the next step.

        Raises:
            GdfeError: the order cannot be carried out.
        """

    def ask(self, ability: Ability) -> Future[str] | None:
        """Carry out a request other than ``MODULI``; ``PAUSE`` and ``RECORD`` are toggles.

        Return a ``Future`` that has a text for the user or raises a GdfeError. Return None if the page itself shows the
        effect.
        """

    def set_moduli(self, moduli: Mapping[str, float]) -> Future[Any]:
        """Set Young's moduli [Pa] by material, if ``MODULI`` is supported; the ``Future`` may raise a GdfeError."""

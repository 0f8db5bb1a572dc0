# SPDX-License-Identifier: Apache-2.0
"""Checked commands on their way to the step that consumes them.

Each tells what is left of it once a later one has come (``without``), None for nothing: what commands another handle or
another actuator takes nothing away.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints import Pose, nearest_turn
from gdfe_ros.node.refusals import Reason, Refusal

FARTHEST = 10.0
"""Of the body's size: the farthest that a handle may be from rest, and the farthest that it may move in a second."""


@dataclass(frozen=True)
class PoseOrder:
    """A target of a handle; which turn its quaternion means depends on the target before it.

    Attributes:
        handle: name.
        translation: from rest [m].
        quaternion: x, y, z, w, of unit length.
    """

    handle: str
    translation: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]

    def without(self, later: Order) -> PoseOrder | None:
        """Stay, but for another pose of the handle; a velocity goes on from here."""
        return None if isinstance(later, PoseOrder) and later.handle == self.handle else self

    def after(self, last: Pose) -> Pose:
        """Choose the turn nearest to the last target's."""
        return Pose(self.translation, nearest_turn(self.quaternion, last))


@dataclass(frozen=True)
class TwistOrder:
    """A velocity of a handle's target, in force until another command or its time is over.

    Attributes:
        handle: name.
        linear: of the handle's centre [m/s].
        angular: about the handle's centre, world axes [rad/s].
    """

    handle: str
    linear: tuple[float, float, float]
    angular: tuple[float, float, float]

    @property
    def still(self) -> bool:
        """Whether it stops the handle."""
        return not any((*self.linear, *self.angular))

    def without(self, later: Order) -> TwistOrder | None:
        """Stay, but for another pose or velocity of the handle."""
        return None if isinstance(later, (PoseOrder, TwistOrder)) and later.handle == self.handle else self

    def after(self, last: Pose, dt: float) -> Pose:
        """Move the last target on for a time ``dt`` [s]; turns add up beyond 180 degrees."""
        translation = np.array(last.translation) + dt * np.array(self.linear)
        turn = dt * np.array(self.angular)
        rotation = Rotation.from_rotvec(turn) * Rotation.from_rotvec(last.rotation)
        expected = Pose(rotation=tuple(np.array(last.rotation) + turn))
        return Pose(tuple(translation), nearest_turn(rotation.as_quat(), expected))


@dataclass(frozen=True)
class PutOrder:
    """Where a rigid body is put.

    Attributes:
        body: name.
        translation: from rest [m].
        quaternion: x, y, z, w, of unit length.
    """

    body: str
    translation: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]

    def without(self, later: Order) -> PutOrder | None:
        """Stay, but for another place of the body."""
        return None if isinstance(later, PutOrder) and later.body == self.body else self

    @property
    def pose(self) -> Pose:
        """Where it is put, relative to rest."""
        return Pose(self.translation, tuple(Rotation.from_quat(self.quaternion).as_rotvec()))


@dataclass(frozen=True)
class ActuatorOrder:
    """Commands of actuators by name, in the unit of each one's mode, and factors of loads; none changes nothing."""

    values: Mapping[str, float]

    def without(self, later: Order) -> ActuatorOrder | None:
        """Keep what a later order does not command; a trajectory begins with what is commanded before it."""
        if not isinstance(later, ActuatorOrder):
            return self
        values = {name: value for name, value in self.values.items() if name not in later.values}
        return ActuatorOrder(values) if values else None


@dataclass(frozen=True, eq=False)
class TrajectoryOrder:
    """Commands of actuators and loads over time, linear between the points; without points they stay as they are.

    Attributes:
        names: of the actuators and loads.
        start: simulation time of the time 0 [s]; None: the step that consumes it.
        times: (k,) ascending, from the start [s].
        values: (k, len(names)) in the units of the modes.
        begun: takes the start [s] and the commands in force then, once a step has consumed it.
    """

    names: tuple[str, ...]
    start: float | None
    times: NDArray[np.float64]
    values: NDArray[np.float64]
    begun: Callable[[float, Collection[float]], object] | None = None

    @property
    def ends(self) -> bool:
        """Whether it ends what runs, and commands nothing."""
        return not len(self.times)

    def without(self, later: Order) -> TrajectoryOrder | None:
        """Keep the actuators that a later order does not command."""
        match later:
            case ActuatorOrder():
                taken = set(later.values)
            case TrajectoryOrder():
                taken = set(later.names)
            case _:
                return self
        kept = [place for place, name in enumerate(self.names) if name not in taken]
        if not kept:
            return None
        return replace(self, names=tuple(self.names[place] for place in kept), values=self.values[:, kept])


Order = PoseOrder | TwistOrder | PutOrder | ActuatorOrder | TrajectoryOrder


def require_near(translation: tuple[float, float, float], size: float) -> None:
    """Check that a target lies within reach of a body of this size [m].

    Raises:
        Refusal: it does not.
    """
    distance = math.hypot(*translation)
    if not distance <= FARTHEST * size:
        raise Refusal(
            Reason.TOO_FAR,
            f"position {translation} is {distance:.3g} m from rest; allowed: {FARTHEST * size:.3g} m, "
            f"{FARTHEST:g} times the body's size",
        )

# SPDX-License-Identifier: Apache-2.0
"""Orders to the simulation, made from command messages, and the inbox in which they wait for their step.

The method ``without`` returns the part of an order that remains valid after a later order, or None. Orders of different
handles or actuators do not affect each other. ``names`` are the names of the commanded items: a handle, a body, or
actuators, loads and joints. ``source`` is the topic or service from which an order came, for refusals; it is empty if
the order came from neither.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.arms.spline import find_excess, spline
from gdfe_ros.constraints import Pose, nearest_turn
from gdfe_ros.errors import CommandError
from gdfe_ros.node.refusals import Reason, Refusal, require_finite

LARGEST_TARGET = 10.0
"""Largest distance of a target from rest, and largest displacement in a second, in multiples of the body's size."""


@dataclass(frozen=True)
class _ItemOrder:
    name: str
    source: str = field(default="", kw_only=True, compare=False)

    @property
    def names(self) -> tuple[str]:
        """Name of the handle or body, as the only name."""
        return (self.name,)


@dataclass(frozen=True)
class PlaceOrder(_ItemOrder):
    """An order with a pose of a handle or a rigid body.

    Attributes:
        name: name of the handle or body.
        translation: translation from rest [m].
        quaternion: x, y, z, w, of unit length.
    """

    translation: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]

    def without(self, later: Order) -> PlaceOrder | None:
        """Return this order, or None if ``later`` is an order of the same kind for the same handle or body.

        A later velocity order does not replace this order: the motion starts from this pose.
        """
        return None if type(later) is type(self) and later.name == self.name else self


class PoseOrder(PlaceOrder):
    """A target pose of a handle.

    Many rotation vectors describe the same quaternion. The order uses the vector closest to that of the last target.
    """

    def after(self, last: Pose) -> Pose:
        """Return the target pose; its rotation vector is the equivalent one closest to that of the last target."""
        return Pose(self.translation, nearest_turn(self.quaternion, last))

    @classmethod
    def toward(cls, name: str, pose: Pose, last: Pose) -> PoseOrder:
        """Return the order that moves a handle from its ``last`` target to ``pose``, both relative to its rest pose.

        Raises:
            CommandError: the handle turns by more than pi, so that the quaternion would turn it in the opposite sense.
        """
        order = cls(name, pose.translation, tuple(Rotation.from_rotvec(pose.rotation).as_quat().tolist()))
        if math.dist(order.after(last).rotation, pose.rotation) > math.pi:  # they differ by whole turns
            axis = np.array(pose.rotation if any(pose.rotation) else last.rotation)
            angle = abs(axis @ np.subtract(pose.rotation, last.rotation)) / np.linalg.norm(axis)
            raise CommandError(
                f"handle {name!r} is commanded to turn by {angle:.4g} rad in one step; allowed in a message with a "
                f"quaternion: less than pi, {math.pi:.4g} rad, from the last target; remedy: several smaller steps"
            )
        return order


@dataclass(frozen=True)
class TwistOrder(_ItemOrder):
    """A velocity of a handle's target, valid until another command or its timeout.

    Attributes:
        name: name of the handle.
        linear: velocity of the handle's centre [m/s].
        angular: angular velocity about the handle's centre, in world axes [rad/s].
    """

    linear: tuple[float, float, float]
    angular: tuple[float, float, float]

    @property
    def still(self) -> bool:
        """Whether the velocity is zero, so that the order stops the handle."""
        return not any((*self.linear, *self.angular))

    def without(self, later: Order) -> TwistOrder | None:
        """Return this order, or None if ``later`` sets another pose or velocity of the handle."""
        return None if isinstance(later, (PoseOrder, TwistOrder)) and later.name == self.name else self

    def after(self, last: Pose, dt: float) -> Pose:
        """Return the last target after motion for ``dt`` [s]; rotations add up beyond 180 degrees."""
        translation = np.array(last.translation) + dt * np.array(self.linear)
        turn = dt * np.array(self.angular)
        rotation = Rotation.from_rotvec(turn) * Rotation.from_rotvec(last.rotation)
        expected = Pose(rotation=tuple(np.array(last.rotation) + turn))
        return Pose(tuple(translation), nearest_turn(rotation.as_quat(), expected))


class TeleportOrder(PlaceOrder):
    """A teleport of a rigid body."""

    @property
    def pose(self) -> Pose:
        """Commanded pose of the body relative to rest."""
        return Pose(self.translation, tuple(Rotation.from_quat(self.quaternion).as_rotvec()))


@dataclass(frozen=True)
class ActuatorOrder:
    """Commands by name: actuator values in the unit of the mode, factors of loads, joint positions [rad] or [m].

    An empty order changes nothing.
    """

    values: Mapping[str, float]
    source: str = field(default="", kw_only=True, compare=False)

    @property
    def names(self) -> Collection[str]:
        """Names of the commanded actuators, loads and joints."""
        return self.values.keys()

    def without(self, later: Order) -> ActuatorOrder | None:
        """Return the commands that a later order does not replace; None if it replaces all.

        A trajectory replaces no commands, because it starts from them.
        """
        if not isinstance(later, ActuatorOrder):
            return self
        values = {name: value for name, value in self.values.items() if name not in later.values}
        return replace(self, values=values) if values else None


@dataclass(frozen=True, eq=False)
class TrajectoryOrder:
    """Commands of actuators, loads and joints over time. An order without points ends running trajectories.

    Attributes:
        names: names of the actuators, loads and joints.
        start: simulation time at which the trajectory starts [s]; None: when the step that consumes the order begins.
        times: (k,) ascending times after the start [s].
        values: (k, len(names)) commands in the units of the modes.
        slopes: (k, len(names)) velocities of the commands, for cubic interpolation; None: linear interpolation.
        bends: (k, len(names)) accelerations of the commands, for quintic interpolation; None: cubic or linear.
        limits: (2, len(names)) least and largest commands, to which rounding is cut; None: no limits.
        begun: function that is called when a step consumes the order, with the start [s], and the commands and
            velocities at the start; None: not called.
        refused: function that is called instead of ``begun``, with the reason, if a step refuses the order; None: not
            called.
    """

    names: tuple[str, ...]
    start: float | None
    times: NDArray[np.float64]
    values: NDArray[np.float64]
    slopes: NDArray[np.float64] | None = None
    bends: NDArray[np.float64] | None = None
    limits: NDArray[np.float64] | None = None
    begun: Callable[[float, Collection[float], Collection[float]], object] | None = None
    refused: Callable[[str], object] | None = None
    source: str = ""

    @property
    def ends(self) -> bool:
        """Whether the order only ends running trajectories."""
        return not len(self.times)

    def without(self, later: Order) -> TrajectoryOrder | None:
        """Return the trajectory without the actuators, loads and joints that a later order commands."""
        kept = [place for place, name in enumerate(self.names) if name not in later.names]
        if not kept or len(kept) == len(self.names):
            return self if kept else None
        tables = {name: getattr(self, name) for name in ("values", "slopes", "bends", "limits")}
        parts = {name: None if table is None else table[:, kept] for name, table in tables.items()}
        return replace(self, names=tuple(self.names[place] for place in kept), **parts)

    def only(self, name: str) -> TrajectoryOrder:
        """Return the trajectory restricted to one actuator, load or joint."""
        return self.without(ActuatorOrder(dict.fromkeys([each for each in self.names if each != name], 0.0))) or self

    def at(
        self, elapsed: float, before: NDArray[np.float64], rates: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Return the interpolated commands (len(names),) at a time after the start.

        Args:
            elapsed: time since the start [s].
            before: commands (len(names),) at the start; the commands before the first point are interpolated from them.
            rates: velocities (len(names),) at the start, for cubic and quintic interpolation; None: 0.
        """
        values = spline(*self._points(before, rates), at=elapsed)
        return values if self.limits is None else np.clip(values, *self.limits)

    def _points(
        self, before: NDArray[np.float64] | None, rates: NDArray[np.float64] | None
    ) -> list[NDArray[np.float64] | None]:
        """Return times and tables of the points, after a first one with the commands ``before`` at the start."""
        points = [self.times, self.values, self.slopes, self.bends]
        if before is None or self.times[0] == 0.0:
            return points
        still = np.zeros(len(before))
        first = [0.0, before, still if rates is None else rates, still]
        return [
            None if each is None else np.concatenate([[row], each]) for row, each in zip(first, points, strict=True)
        ]

    def require_limits(
        self, before: NDArray[np.float64] | None = None, rates: NDArray[np.float64] | None = None
    ) -> None:
        """Check that a cubic or quintic trajectory does not leave the limits between its points.

        Args:
            before: commands (len(names),) at the start, to check the segment from there to the first point; None: the
                segments between the points are checked.
            rates: velocities (len(names),) at the start; None: 0.

        Raises:
            Refusal: a command leaves its limits by more than rounding.
        """
        if self.limits is None:
            return
        points = self._points(before, rates)
        if before is not None:
            points = [None if each is None else each[:2] for each in points]
        if (found := find_excess(*points, low=self.limits[0], high=self.limits[1])) is not None:
            column, elapsed, value = found
            low, high = self.limits[:, column]
            raise Refusal(
                Reason.OUT_OF_RANGE,
                f"{elapsed:.6g} s after its start, between two points, the trajectory takes {self.names[column]!r} to "
                f"{value:.6g}; allowed: {low:g} to {high:g}; remedy: smaller velocities there, or more points",
            )


Order = PoseOrder | TwistOrder | TeleportOrder | ActuatorOrder | TrajectoryOrder


def require_near(translation: tuple[float, float, float], size: float) -> None:
    """Check that a target is not too far from rest for a body of this size [m].

    Raises:
        Refusal: the distance exceeds `LARGEST_TARGET` times the size.
    """
    distance = math.hypot(*translation)
    if not distance <= LARGEST_TARGET * size:
        raise Refusal(
            Reason.TOO_FAR,
            f"position {translation} is {distance:.3g} m from rest; allowed: {LARGEST_TARGET * size:.3g} m, "
            f"{LARGEST_TARGET:g} times the body's size",
        )


def require_order(name: str, order: Order, size: float) -> None:
    """Check a pose or actuator order that was not made from a command message, e.g. an order of the live page.

    Args:
        name: name of the commanded handle or body, for messages.
        order: given order.
        size: size of the body [m].

    Raises:
        Refusal: a number is not finite, or a target is too far from rest.
    """
    match order:
        case PlaceOrder():
            require_finite(**{name: (*order.translation, *order.quaternion)})
            require_near(order.translation, size)
        case ActuatorOrder():
            require_finite(**{each: (value,) for each, value in order.values.items()})


_LIMIT = 10_000
"""Largest number of commands that wait for their step in lockstep."""


class Inbox:
    """Commands that wait for their step.

    In lockstep no command is dropped. The commands of each input are queued in the order received. With a command set,
    a step consumes one command of each input. Without a command set, it consumes the oldest command only. Under the
    other clocks only the latest command for each handle and each actuator is kept, whatever its sender and topic.

    Args:
        changed: condition that is notified when a command arrives; its lock guards the inbox.
        queued: whether the clock is lockstep.
        command_set: names of inputs; a step begins once each has a command. If it is empty, one command is enough.
    """

    def __init__(self, changed: threading.Condition, *, queued: bool, command_set: Collection[str] = ()) -> None:
        self._changed = changed
        self._queued = queued
        self._set = frozenset(command_set)
        self._waiting: dict[str, deque[tuple[int, Order]]] = {}
        self._latest: list[Order] = []
        self._count = self._number = 0

    def put(self, name: str, order: Order) -> None:
        """Add an order of the input ``name``.

        Raises:
            Refusal: in lockstep, ten thousand commands are waiting already.
        """
        with self._changed:
            if self._queued:
                self._append(name, order)
            else:
                left = [old.without(order) for old in self._latest]
                self._latest = [old for old in left if old is not None]
                if order != ActuatorOrder({}):
                    self._latest.append(order)
            self._changed.notify_all()

    def _append(self, name: str, order: Order) -> None:
        if self._count >= _LIMIT:
            raise Refusal(Reason.QUEUE_FULL, f"{_LIMIT} commands wait for their step; send slower")
        self._waiting.setdefault(name, deque()).append((self._number, order))
        self._number += 1
        self._count += 1

    def ready(self) -> bool:
        """Return whether the next step has its commands: in lockstep the command set, else any. Needs the lock."""
        if self._queued and self._set:
            return not self.missing()
        return self._count > 0 or bool(self._latest)

    def missing(self) -> list[str]:
        """Return the inputs of the command set that have no command yet, sorted. Needs the lock."""
        return sorted(name for name in self._set if not self._waiting.get(name))

    def remove_next(self) -> list[Order]:
        """Remove and return the orders that the next step consumes, in the order received. Needs the lock."""
        if not self._queued:
            latest, self._latest = self._latest, []
            return latest
        queues = sorted((queue for queue in self._waiting.values() if queue), key=lambda queue: queue[0][0])
        if not self._set:
            queues = queues[:1]
        self._count -= len(queues)
        return [queue.popleft()[1] for queue in queues]

    def take_over(self, other: Inbox, bodies: Collection[str]) -> None:
        """Continue with the waiting commands of another inbox, except teleports of bodies not in ``bodies``."""
        self._count, self._number = 0, other._number
        self._latest = [order for order in other._latest if not _is_lost(order, bodies)]
        for name, queue in other._waiting.items():
            self._waiting[name] = deque(entry for entry in queue if not _is_lost(entry[1], bodies))
            self._count += len(self._waiting[name])

    def clear(self) -> None:
        """Drop all waiting commands, e.g. at a reset."""
        with self._changed:
            self._waiting.clear()
            self._latest.clear()
            self._count = 0


def _is_lost(order: Order, bodies: Collection[str]) -> bool:
    return isinstance(order, TeleportOrder) and order.name not in bodies

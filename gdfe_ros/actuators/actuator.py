# SPDX-License-Identifier: Apache-2.0
"""Actuators of a scene, their states, and the positions in messages about joints. SI units."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.embedding import Embedding
from gdfe_ros.mesh.cavities import inside_volume
from gdfe_ros.untrusted.real_number import require_command

_LENGTH, _TENSION = ("length", "m"), ("tension", "N")
_VOLUME, _PRESSURE = ("volume", "m^3"), ("pressure", "Pa")


class Mode(str, Enum):
    """Quantity that an actuator's command prescribes, and the quantities that the actuator reports.

    The extent is a function of the positions, and the effort does work on it: length and tension, volume and pressure.
    If the value of a member is also the name of its extent or effort, the command prescribes that quantity. Members are
    written as value, unit, extent, effort and limits.

    Attributes:
        unit: SI unit of the command; empty if it has no unit.
        extent, extent_unit: name and SI unit of `ActuatorState.extent`; the unit is empty if it has none.
        effort, effort_unit: name and SI unit of `ActuatorState.effort`; both are empty if there is none.
        limits: widest range (low, high) of commands that a scene may give, in ``unit``.
    """

    TENSION = "tension", "N", _LENGTH, _TENSION, (0.0, math.inf)
    LENGTH = "length", "m", _LENGTH, _TENSION, (0.0, math.inf)
    SHORTENING = "shortening", "m", _LENGTH, _TENSION, (-math.inf, math.inf)
    PRESSURE = "pressure", "Pa", _VOLUME, _PRESSURE, (-math.inf, math.inf)
    VOLUME = "volume", "m^3", _VOLUME, _PRESSURE, (0.0, math.inf)
    GROWTH = "growth", "", ("grown volume ratio", ""), ("", ""), (0.0, 1.0)
    GRIP = "grip", "", ("holds", ""), ("force", "N"), (0.0, 1.0)

    def __new__(
        cls, value: str, unit: str, extent: tuple[str, str], effort: tuple[str, str], limits: tuple[float, float]
    ) -> Mode:
        """Return a member with this value, and with the other arguments as attributes."""
        member = str.__new__(cls, value)
        member._value_, member.unit, member.limits = value, unit, limits
        (member.extent, member.extent_unit), (member.effort, member.effort_unit) = extent, effort
        return member

    @property
    def by_effort(self) -> bool:
        """Whether the command is the effort, e.g. a tension. JointState messages have it in ``effort``."""
        return self.value == self.effort

    @property
    def by_extent(self) -> bool:
        """Whether the command is the extent, e.g. a length."""
        return self.value == self.extent

    @property
    def conjugate(self) -> Mode | None:
        """The mode that commands the extent instead of this mode's effort; None if there is none."""
        return next((mode for mode in Mode if self.by_effort and mode.value == self.extent), None)

    @property
    def position(self) -> tuple[str, str]:
        """Name and SI unit of the ``position`` in ``~/joint_states``: the extent, or a command of another quantity."""
        plain = self.by_effort or self.by_extent
        return (self.extent, self.extent_unit) if plain else (self.value, self.unit)


@dataclass(frozen=True, eq=False, kw_only=True)
class Actuator:
    """Base class of actuators.

    Attributes:
        name: name, unique among the actuators and loads of the scene; commands on ``~/actuation`` use it.
        mode: quantity that the command prescribes.
        low, high: range of the command, in the unit of the mode.
        rate: largest change of the command in a second of simulation time; infinite for no limit.
    """

    name: str
    mode: Mode
    low: float = -math.inf
    high: float = math.inf
    rate: float = math.inf

    def neutral(self, rest: NDArray[np.float64]) -> float:
        """Return the command that leaves the undeformed body as it is; ``rest`` (n, 3) [m] are its vertices."""
        return 0.0

    @property
    def constrains(self) -> bool:
        """Whether the command is a constraint on a length or a volume; its tension or pressure is then an unknown."""
        return self.mode is Mode.VOLUME

    def require(self, value: object) -> float:
        """Return a command, after a check.

        Raises:
            CommandError: the command is no finite number within the range.
        """
        what = f"actuator {self.name!r}: {self.mode.value}"
        return require_command(what, value, low=self.low, high=self.high, unit=self.mode.unit)

    def seen_from(self, origin: NDArray[np.float64]) -> Actuator:
        """Return the actuator for positions relative to ``origin`` (3,) [m]: only points fixed in the world change."""
        return self


@dataclass(frozen=True, eq=False, kw_only=True)
class Cable(Actuator):
    """A frictionless cable along a polyline of length L; it pulls and never pushes.

    With a commanded tension T its energy is T L. A commanded length l is the constraint L <= l: while L < l, the cable
    is slack. With a finite ``stiffness`` k the cable is elastic instead of constrained: its energy is k/2 (L - l)^2 for
    L > l.

    Attributes:
        points: two or more points of the body or the world, from one end of the cable to the other.
        stiffness: stiffness k of the whole cable [N/m]; infinite for an inextensible cable.
    """

    points: Embedding
    stiffness: float = math.inf

    @property
    def constrains(self) -> bool:
        """Whether the command is a constraint on the cable's length; an elastic cable has no constraint."""
        return self.mode is not Mode.TENSION and not math.isfinite(self.stiffness)

    def length(self, positions: NDArray[np.float64]) -> float:
        """Return the length [m] of the polyline at ``positions`` (n, 3) [m] of the mesh's vertices."""
        return float(np.linalg.norm(np.diff(self.points.at(positions), axis=0), axis=1).sum())

    def neutral(self, rest: NDArray[np.float64]) -> float:
        """Return the undeformed length [m] if a length is commanded, else 0."""
        return self.length(rest) if self.mode is Mode.LENGTH else 0.0

    def seen_from(self, origin: NDArray[np.float64]) -> Cable:
        """Return the cable for positions relative to ``origin`` (3,) [m]."""
        return replace(self, points=self.points.seen_from(origin))


@dataclass(frozen=True, eq=False, kw_only=True)
class Chamber(Actuator):
    """A cavity of the body with fluid in it; its surface is closed, or plates that move with handles close it.

    With a commanded pressure p its energy is -p V. A commanded volume is a constraint, whose pressure is an unknown.

    Attributes:
        quads: int32 vertex ids of the faces, (q, 4), or (q, 6) for tetrahedra; normals point into the material. If
            ``points`` are given, indices (q, 4) of these points; a triangle repeats its last corner.
        points: material points as corners of the faces; None if the corners are vertices.
        least: smallest reference volume [m^3] of limits that are relative to the chamber's volume. It is needed with
            plates, because the undeformed volume may then be zero.
    """

    quads: NDArray[np.int32]
    points: Embedding | None = None
    least: float = 0.0

    @property
    def vertices(self) -> NDArray[np.int32]:
        """Vertices (k,) on which the surface's position depends; some occur more than once."""
        return self.quads.ravel() if self.points is None else self.points.corners[self.points.weights != 0.0]

    def at(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the positions (k, 3) [m] to which ``quads`` refer: of ``points`` if given, else of the vertices.

        Args:
            positions: positions of the mesh's vertices (n, 3) [m].
        """
        return positions if self.points is None else self.points.at(positions)

    def volume(self, positions: NDArray[np.float64]) -> float:
        """Return the volume [m^3] inside the surface at ``positions`` (n, 3) [m] of the mesh's vertices."""
        return inside_volume(self.at(positions), self.quads)

    def neutral(self, rest: NDArray[np.float64]) -> float:
        """Return the undeformed volume [m^3] if a volume is commanded, else 0."""
        return self.volume(rest) if self.mode is Mode.VOLUME else 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Growth(Actuator):
    """Cells whose stress-free shape changes (shape memory, swelling, fibres): F_e = F G^-1, energy det G W(F_e).

    At command c the growth stretch is G = 1 + c (G_1 - 1). If several growths have a cell in common, their tensors
    G - 1 are added.

    Attributes:
        cells: (k,) int32 cells that grow.
        stretch: (3, 3) growth stretch G_1 at command 1, symmetric and positive definite.
    """

    cells: NDArray[np.int32]
    stretch: NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Grip(Actuator):
    """A grip, by which a handle, an obstacle or a rigid body holds vertices of the body or another rigid body.

    When the command becomes 1, the held points are fixed to the holder where they are. At command 0 nothing is held. A
    command between them counts as the nearer one.

    Attributes:
        holder: name of the handle, the obstacle or the rigid body that holds.
        held: name of the rigid body that is held; empty if vertices of the body are held.
        vertices: (k,) int32 held vertices of the body; empty if a rigid body is held.
        reach: largest distance [m] between the holder and the held points when the grip closes.
    """

    holder: str
    held: str = ""
    vertices: NDArray[np.int32]
    reach: float
    low: float = 0.0
    high: float = 1.0

    @property
    def constrains(self) -> bool:
        """Whether the command is a constraint: always, on the positions of the held points."""
        return True


@dataclass(frozen=True)
class ActuatorState:
    """State of an actuator at the present equilibrium.

    Attributes:
        mode: quantity that the command prescribes; it has the names and units of the numbers below.
        command: present command.
        extent: e.g. the length of a cable, the mean of det G over the cells of a growth, 1 for a grip that holds.
        effort: e.g. the tension of a cable, the pressure of a chamber relative to its surroundings; 0 if the mode has
            none.
    """

    mode: Mode
    command: float
    extent: float
    effort: float

    @property
    def unit(self) -> str:
        """SI unit of the command."""
        return self.mode.unit

    def readings(self) -> list[tuple[str, float, str]]:
        """Return the values to report for the actuator, as a list of (quantity, value, unit)."""
        mode, found = self.mode, [(self.mode.extent, self.extent, self.mode.extent_unit)]
        if mode.effort:
            found.append((mode.effort, self.effort, mode.effort_unit))
        return found


class Readings:
    """Converter of actuator states to positions in messages. `Mode.position` has their names and units.

    Args:
        actuators: actuators of a scene.
        rest: undeformed vertices (n, 3) [m].
    """

    def __init__(self, actuators: Iterable[Actuator], rest: NDArray[np.float64]) -> None:
        self._lengths = {item.name: item.length(rest) for item in actuators if item.mode is Mode.SHORTENING}

    def positions(self, states: Mapping[str, ActuatorState]) -> NDArray[np.float64]:
        """Return the positions (k,) of actuators from a dict from name to state, in the order of the dict."""
        return np.array([self._position(name, state) for name, state in states.items()])

    def _position(self, name: str, state: ActuatorState) -> float:
        if state.mode is Mode.SHORTENING:
            return self._lengths[name] - state.extent
        return state.extent if state.mode.by_effort or state.mode.by_extent else state.command

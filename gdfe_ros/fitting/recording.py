# SPDX-License-Identifier: Apache-2.0
"""Recordings for a fit: measured series, the simulated quantities compared with them, and commands over time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators import Actuator
from gdfe_ros.command import Command
from gdfe_ros.constraints import Pose
from gdfe_ros.errors import GdfeError
from gdfe_ros.scene.scene import Scene

if TYPE_CHECKING:
    from gdfe_ros.simulation import Simulation


class QuantityKind(Enum):
    """Kinds of measured quantities. Positions are vectors [m]; a recording may give them in its own frame."""

    PROBE = "probe"
    MEAN = "mean"
    HANDLE = "handle"
    VERTICES = "vertices"
    SURFACE = "surface"
    FORCE = "force"
    EFFORT = "effort"
    EXTENT = "extent"


POSITIONS = (QuantityKind.PROBE, QuantityKind.MEAN, QuantityKind.HANDLE, QuantityKind.VERTICES, QuantityKind.SURFACE)
CLOUDS = (QuantityKind.VERTICES, QuantityKind.SURFACE)


@dataclass(frozen=True, eq=False)
class Observable:
    """A simulated quantity.

    Attributes:
        kind: kind of the quantity.
        name: name of the probe, handle or actuator.
        vertices: indices (k,) of the vertices whose mean position is the quantity.
        displacement: whether positions are relative to the undeformed body.
        actuator_unit: SI unit of an actuator's quantity.
    """

    kind: QuantityKind
    name: str = ""
    vertices: NDArray[np.int32] | None = None
    displacement: bool = False
    actuator_unit: str = ""

    @property
    def unit(self) -> str:
        """SI unit of the values."""
        return "m" if self.kind in POSITIONS else "N" if self.kind is QuantityKind.FORCE else self.actuator_unit

    def of(self, simulation: Simulation) -> NDArray[np.float64]:
        """Return the present values: (3,) for a point or a force, (1,) for an actuator, (3 n,) for n vertices."""
        if self.kind is QuantityKind.HANDLE:
            return np.array(simulation.handle_pose(self.name).translation)
        if self.kind in POSITIONS:
            values, scene = self._place(simulation.scene, simulation.positions), simulation.scene
            return (values - self._place(scene, scene.mesh.vertices)) if self.displacement else values
        if self.kind is QuantityKind.FORCE:
            result = simulation.result
            return np.zeros(3) if result is None else np.array(result.reactions[self.name][:3])
        state = simulation.actuator_states()[self.name]
        return np.array([state.effort if self.kind is QuantityKind.EFFORT else state.extent])

    def _place(self, scene: Scene, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a probe, a mean or a cloud of a body whose vertices are at ``positions`` (n, 3)."""
        if self.kind is QuantityKind.PROBE:
            return scene.probes[self.name].at(positions)[0]
        return positions[self.vertices].mean(axis=0) if self.kind is QuantityKind.MEAN else positions.ravel()


def require_known(kind: QuantityKind, name: str, scene: Scene, where: str) -> None:
    """Check that the scene has the probe, handle or actuator ``name``.

    Raises:
        GdfeError: the scene does not have it.
    """
    handles = "handle", [handle.name for handle in scene.handles]
    actuators = "actuator", [actuator.name for actuator in scene.actuators]
    noun, known = {
        QuantityKind.PROBE: ("probe", list(scene.probes)),
        QuantityKind.HANDLE: handles,
        QuantityKind.FORCE: handles,
        QuantityKind.EFFORT: actuators,
        QuantityKind.EXTENT: actuators,
    }.get(kind, ("", [name]))
    if name not in known:
        raise GdfeError(f"{where}: no {noun} {name!r} in scene {scene.name!r}; it has {', '.join(known) or 'none'}")


TIME, ROW = "time [s]", "row"
"""Values of `Recording.over`: the abscissa of series with times, and of series without."""


@dataclass(frozen=True, eq=False)
class Series:
    """Measured values of one quantity.

    Attributes:
        name: name in tables and pictures.
        observable: simulated quantity with which it is compared.
        times: (m,) [s] on the recording's clock, or row numbers of a file without times; ascending.
        values: (m, c) in SI units, or (m, p, 3) for points on a surface; NaN if a value is missing.
        along: matrix (c, d) from the d simulated values to the c measured values; None for the identity.
        labels: labels of the c columns.
        sigma: standard deviation of a value in SI units; None if unknown.
    """

    name: str
    observable: Observable
    times: NDArray[np.float64]
    values: NDArray[np.float64]
    labels: tuple[str, ...]
    along: NDArray[np.float64] | None = None
    sigma: float | None = None

    @property
    def count(self) -> int:
        """Number of measured values; for points on a surface, number of measured points."""
        finite = np.isfinite(self.values)
        return int(finite.all(axis=2).sum()) if self.values.ndim == 3 else int(finite.sum())

    @property
    def span(self) -> float:
        """Largest range of the values of a column; missing values (NaN) are left out."""
        ranges = np.fmax.reduce(self.values, axis=0) - np.fmin.reduce(self.values, axis=0)
        return float(np.fmax.reduce(ranges.ravel(), initial=0.0))

    @property
    def largest(self) -> float:
        """Largest magnitude of a value; missing values (NaN) are left out."""
        return float(np.fmax.reduce(np.abs(self.values).ravel(), initial=0.0))


@dataclass(frozen=True, eq=False)
class Schedule:
    """Steps of a simulation with their commands.

    Attributes:
        times: ends of the steps (k,) on the simulation's clock [s], ascending.
        commands: command of each step (k,).
    """

    times: NDArray[np.float64]
    commands: tuple[Command, ...]


@dataclass(frozen=True, eq=False)
class Recording:
    """One recording: measured series, and the steps and commands of its simulation.

    Attributes:
        name: name of the recording.
        series: measured series.
        schedule: steps and commands of its simulation.
        overrides: dict from dotted scene key to the value for this recording.
        shift: time [s] by which the recording's clock is ahead of the simulation's, or its initial value for a fit.
        shift_between: bounds of the fitted time shift [s]; None if it is not fitted.
        frame: number of fitted unknowns of the frame: 0, 3 (translation) or 6 (rotation vector, translation).
        from_equilibrium: whether a motion starts from the equilibrium of its first commands, not from the scene's
            initial state.
        remarks: remarks for the user on reading the recording.
        over: the quantity along which values are drawn: time, or the number of a row in a file without times.
    """

    name: str
    series: tuple[Series, ...]
    schedule: Schedule
    overrides: Mapping[str, Any] = field(default_factory=dict)
    shift: float = 0.0
    shift_between: tuple[float, float] | None = None
    frame: int = 0
    from_equilibrium: bool = False
    remarks: tuple[str, ...] = ()
    over: str = TIME

    @property
    def unknowns(self) -> int:
        """Number of the recording's unknowns: time shift and frame."""
        return self.frame + (self.shift_between is not None)

    @property
    def count(self) -> int:
        """Number of measured values."""
        return sum(series.count for series in self.series)


@dataclass(frozen=True, eq=False)
class Track:
    """Commands of one actuator, load or handle over time.

    Attributes:
        name: name of the actuator, load or handle.
        times: times of the commands (m,) [s], ascending.
        values: commands in SI units: (m, 1) for an actuator or load; for a handle, (m, 3) translations, or (m, 6)
            translations and rotation vectors.
        held: whether a command is constant until the next command, as for messages. Otherwise commands are
            interpolated linearly.
    """

    name: str
    times: NDArray[np.float64]
    values: NDArray[np.float64]
    held: bool = False

    def at(self, time: float) -> NDArray[np.float64]:
        """Return the command (d,) at a ``time`` [s]."""
        if self.held:
            return self.values[max(int(np.searchsorted(self.times, time + 1e-12, side="right")) - 1, 0)]
        return np.array([np.interp(time, self.times, column) for column in self.values.T])


def constant(name: str, value: float) -> Track:
    """Return the track of a constant command."""
    return Track(name, np.zeros(1), np.full((1, 1), value))


def require_commanded(tracks: Sequence[Track], scene: Scene, where: str) -> None:
    """Check that the scene accepts the commands.

    Raises:
        GdfeError: a name is unknown, a command has the wrong number of components, is missing, or is out of range.
    """
    drives = [*(item.name for item in scene.actuators), *(item.name for item in scene.loads)]
    movers = [handle.name for handle in scene.handles if not handle.fixed]
    for track in tracks:
        if track.name not in drives + movers:
            known = ", ".join(drives + movers) or "none"
            raise GdfeError(f"{where}: scene {scene.name!r} takes no command {track.name!r}; it takes {known}")
        counts = (3, 6) if track.name in movers else (1,)
        if track.values.shape[1] not in counts:
            text = f"a command of {track.name!r} has {track.values.shape[1]} numbers; allowed: {counts[0]}"
            raise GdfeError(
                f"{where}: {text}; remedy: `columns: {{x: ..., y: ..., z: ...}}` for a handle, else `column`"
            )
        if not np.isfinite(track.values).all():
            raise GdfeError(f"{where}: a command of {track.name!r} is missing")
        if actuator := next((each for each in scene.actuators if each.name == track.name), None):
            _require_range(track.values, actuator, where)


def _require_range(values: NDArray[np.float64], actuator: Actuator, where: str) -> None:
    """Check that commands (m, 1) are in the range of an actuator; if not, their unit is probably wrong."""
    slack = 1e-9 * max(abs(values.min()), abs(values.max()))
    if actuator.low - slack <= values.min() and values.max() <= actuator.high + slack:
        return
    quantity = f"{actuator.mode.value} [{actuator.mode.unit or 1}]"
    raise GdfeError(
        f"{where}: the commands of {actuator.name!r} are from {values.min():g} to {values.max():g}; allowed: "
        f"{actuator.low:g} <= {quantity} <= {actuator.high:g}; remedy: the `unit` of this command in the match file, "
        f"or the key actuators.{actuator.name}.range of the scene"
    )


def make_schedule(tracks: Sequence[Track], scene: Scene, moments: NDArray[np.float64]) -> Schedule:
    """Return the steps of a simulation that follows tracks.

    Args:
        tracks: recorded commands.
        scene: scene to simulate.
        moments: times [s] at which the simulation is compared. Without dynamics, each of these times has a step to an
            equilibrium. With dynamics, the steps have the length of the scene's internal steps and end after the last
            of these times.
    """
    if scene.dynamics is None:
        times = np.unique(moments)
    else:
        step = scene.dynamics.step
        times = step * np.arange(1, max(1, math.ceil(float(moments.max()) / step - 1e-9)) + 1)
    starts = np.concatenate([[0.0], times[:-1]]) if scene.dynamics is not None else times
    loads = {load.name for load in scene.loads}
    drives = {actuator.name for actuator in scene.actuators}
    commands = []
    for start, end in zip(starts, times, strict=True):
        given = {track.name: track.at(float(start if track.held else end)) for track in tracks}
        commands.append(
            Command(
                handles={n: _pose(v) for n, v in given.items() if n not in loads | drives},
                actuators={n: float(v[0]) for n, v in given.items() if n in drives},
                loads={n: float(v[0]) for n, v in given.items() if n in loads},
            )
        )
    return Schedule(times, tuple(commands))


def _pose(values: NDArray[np.float64]) -> Pose:
    six = [*map(float, values), *([0.0] * (6 - len(values)))]
    return Pose(tuple(six[:3]), tuple(six[3:]))

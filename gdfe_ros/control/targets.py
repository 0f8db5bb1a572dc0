# SPDX-License-Identifier: Apache-2.0
"""What inverse control leads to a goal: positions and orientations of probes, contact forces."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.errors import CommandError
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Simulation

Array = NDArray[np.float64]
WAY, TURN = 0.1, 0.5
"""Longest way of a probe, over the body's size, and longest turn [rad] that one change of the commands asks for."""


@dataclass(frozen=True, kw_only=True)
class Aim(ABC):
    """What every target has.

    Attributes:
        axes: which of x, y, z count, by number.
        weight: priority beside other targets: errors, each over its tolerance, count by its root.
        tolerance: distance at which a goal counts as reached, in the unit of the target; None: the control's for
            positions, 1e-3 rad and 1e-3 N.

    Raises:
        ValueError: an axis is none, or the weight or the tolerance is not positive.
    """

    axes: tuple[int, ...] = (0, 1, 2)
    weight: float = 1.0
    tolerance: float | None = None

    unit: ClassVar[str]
    """SI unit of goals."""

    def __post_init__(self) -> None:
        if not self.axes or not set(self.axes) <= {0, 1, 2}:
            raise ValueError(f"axes of target {self.name!r} must be some of 0, 1, 2, got {self.axes!r}")
        for what, value in (("weight", self.weight), ("tolerance", self.tolerance)):
            if value is not None and not 0.0 < value < np.inf:
                raise ValueError(f"the {what} of target {self.name!r} must be positive and finite, got {value!r}")

    @property
    @abstractmethod
    def name(self) -> str:
        """What it is called in messages."""

    @property
    @abstractmethod
    def output(self) -> str:
        """The output of `Simulation.sensitivities` that tells its derivative."""

    @abstractmethod
    def require_in(self, scene: Scene) -> None:
        """Refuse a scene that lacks what it is of.

        Raises:
            CommandError: the scene lacks it.
        """

    @abstractmethod
    def value(self, simulation: Simulation) -> Array:
        """Return its present value (3,)."""

    @abstractmethod
    def longest(self, simulation: Simulation, goal: Array, value: Array) -> float:
        """Return the longest way from a value (3,) to a goal (3,) that one change of the commands asks for."""

    def missing(self, goal: Array, value: Array) -> Array:
        """Return what is missing (3,) from a value (3,) to a goal (3,)."""
        return goal - value

    def derivative(self, simulation: Simulation, output: Array) -> Array:
        """Return its derivative (3, n) from that of its output (k, n)."""
        return output[:3]

    def obstacle(self, value: Array) -> str:
        """Say why no command leads it anywhere from a value (3,); empty where that is not known."""
        return ""


@dataclass(frozen=True, kw_only=True)
class ProbeTarget(Aim):
    """A target of a probe.

    Attributes:
        probe: its name.
    """

    probe: str

    def require_in(self, scene: Scene) -> None:
        """Refuse a scene without the probe."""
        if self.probe not in scene.probes:
            raise CommandError(f"no probe {self.probe!r}; probes: {', '.join(scene.probes) or 'none'}")


@dataclass(frozen=True, kw_only=True)
class Target(ProbeTarget):
    """Where a probe is to be; its goal is a position [m]."""

    unit = "m"

    @property
    def name(self) -> str:
        """The probe's."""
        return self.probe

    @property
    def output(self) -> str:
        """The probe's position."""
        return f"probes.{self.probe}"

    def value(self, simulation: Simulation) -> Array:
        """Return where the probe is (3,) [m]."""
        return simulation.probe_positions()[self.probe]

    def longest(self, simulation: Simulation, goal: Array, value: Array) -> float:
        """Return a share of the body's size [m]."""
        return WAY * simulation.mesh.size


@dataclass(frozen=True, kw_only=True)
class OrientationTarget(ProbeTarget):
    """How a probe is to be turned; its goal is a rotation vector [rad] from rest.

    The rotation is the one that fits the corners of the cell around the probe best, as on ``~/probe/<name>``. Axes are
    those of the turn that is still missing, in the scene's frame.
    """

    unit = "rad"

    @property
    def name(self) -> str:
        """The probe's, with what of it."""
        return f"orientation of {self.probe}"

    @property
    def output(self) -> str:
        """All vertices; the rotation is that of some of them."""
        return "positions"

    def value(self, simulation: Simulation) -> Array:
        """Return the rotation vector (3,) [rad]."""
        now, rest = self._corners(simulation)
        return Rotation.align_vectors(now, rest)[0].as_rotvec()

    def longest(self, simulation: Simulation, goal: Array, value: Array) -> float:
        """Return a part of a turn [rad]."""
        return TURN

    def missing(self, goal: Array, value: Array) -> Array:
        """Return the rotation vector (3,) [rad] of the turn that is missing."""
        return (Rotation.from_rotvec(goal) * Rotation.from_rotvec(value).inv()).as_rotvec()

    def derivative(self, simulation: Simulation, output: Array) -> Array:
        """Return the turns (3, n) [rad] of motions (3 v, n) [m] of the vertices.

        The corners x, at rest X, about their means have the best rotation R. With y = R X and V = sum x y^T, motions dx
        turn R by w with (tr V - V) w = sum y x dx.
        """
        now, rest = self._corners(simulation)
        turned = Rotation.align_vectors(now, rest)[0].apply(rest)
        stretch = now.T @ turned
        vertices = simulation.scene.probes[self.probe].corners[0]
        motions = output.reshape(-1, 3, output.shape[1])[vertices].transpose(0, 2, 1)
        moments = np.cross(turned[:, None, :], motions).sum(axis=0).T
        return np.linalg.solve(np.trace(stretch) * np.eye(3) - 0.5 * (stretch + stretch.T), moments)

    def _corners(self, simulation: Simulation) -> tuple[Array, Array]:
        """Return the corners (8, 3) [m] of the probe's cell about their mean, now and at rest."""
        vertices = simulation.scene.probes[self.probe].corners[0]
        now, rest = simulation.positions[vertices], simulation.mesh.vertices[vertices]
        return now - now.mean(axis=0), rest - rest.mean(axis=0)


@dataclass(frozen=True, kw_only=True)
class ForceTarget(Aim):
    """How hard an obstacle is to press on the body, or a handle to hold it; its goal is that force [N] on the body.

    A force has a derivative only where something touches: bring the body into contact first.

    Attributes:
        contact: name of the obstacle or handle.
    """

    contact: str

    unit = "N"

    @property
    def name(self) -> str:
        """The obstacle's, with what of it."""
        return f"force of {self.contact}"

    @property
    def output(self) -> str:
        """Its reaction."""
        return f"reactions.{self.contact}"

    def require_in(self, scene: Scene) -> None:
        """Refuse a scene without the obstacle or handle."""
        known = [handle.name for handle in scene.handles]
        if self.contact not in known:
            raise CommandError(f"no obstacle or handle {self.contact!r}; there are: {', '.join(known) or 'none'}")

    def value(self, simulation: Simulation) -> Array:
        """Return the force (3,) [N]."""
        if simulation.result is None:  # after a restore; nothing moves
            simulation.step()
        return simulation.result.reactions[self.contact][:3]

    def longest(self, simulation: Simulation, goal: Array, value: Array) -> float:
        """Return the larger of the goal and the present force [N]."""
        return max(float(np.linalg.norm(goal)), float(np.linalg.norm(value)), 1e-300)

    def obstacle(self, value: Array) -> str:
        """Say that nothing touches."""
        return "" if value.any() else f"nothing touches {self.contact}: bring the body there first"

# SPDX-License-Identifier: Apache-2.0
"""Targets of inverse control: positions and orientations of probes, contact forces."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.errors import CommandError, require_named
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Simulation

Array = NDArray[np.float64]
MOTION, TURN = 0.1, 0.5
"""Limits of the effect of one change of the commands: largest motion of a probe, divided by the body's size, and
largest rotation of a probe [rad].
"""


@dataclass(frozen=True, kw_only=True)
class Aim(ABC):
    """Base class of targets.

    Attributes:
        axes: controlled components of the value: 0, 1, 2 for x, y, z.
        weight: priority relative to other targets: factor on (error / tolerance)^2 in the sum that is minimised.
        tolerance: distance at which a goal counts as reached, in the unit of the target. None means the controller's
            tolerance for positions, 1e-3 rad for orientations, and 1e-3 N for forces.

    Raises:
        ValueError: an axis is not 0, 1 or 2, or the weight or the tolerance is not positive.
    """

    axes: tuple[int, ...] = (0, 1, 2)
    weight: float = 1.0
    tolerance: float | None = None

    unit: ClassVar[str]
    """SI unit of goals."""

    def __post_init__(self) -> None:
        whole = all(isinstance(axis, int | np.integer) for axis in self.axes)
        if not self.axes or not whole or sorted({0, 1, 2} & set(self.axes)) != sorted(self.axes):
            raise ValueError(f"axes of target {self.name!r} must be some of 0, 1, 2, each once, got {self.axes!r}")
        for what, value in (("weight", self.weight), ("tolerance", self.tolerance)):
            if value is not None and not 0.0 < value < np.inf:
                raise ValueError(f"the {what} of target {self.name!r} must be positive and finite, got {value!r}")

    @property
    @abstractmethod
    def name(self) -> str:
        """Name of the target in messages."""

    @property
    @abstractmethod
    def output(self) -> str:
        """Name of the output of `Simulation.sensitivities` from which the target's derivative is computed."""

    @abstractmethod
    def require_in(self, scene: Scene) -> None:
        """Check that the scene has the target's probe, obstacle or handle.

        Raises:
            CommandError: the scene does not have it.
        """

    @abstractmethod
    def value(self, simulation: Simulation) -> Array:
        """Return the present value of the target (3,) in its unit."""

    @abstractmethod
    def longest(self, simulation: Simulation, goal: Array, value: Array) -> float:
        """Return the largest allowed effect of one change of the commands, in the unit of the target.

        The change leads from ``value`` (3,) towards ``goal`` (3,).
        """

    def missing(self, goal: Array, value: Array) -> Array:
        """Return the difference goal - value (3,)."""
        return goal - value

    def derivative(self, simulation: Simulation, output: Array) -> Array:
        """Return the derivative of the target (3, n), from the derivative of its output (k, n)."""
        return output[:3]

    def obstacle(self, simulation: Simulation, value: Array) -> str:
        """Return a possible reason why commands do not change the target's ``value`` (3,); empty if there is none."""
        return ""


@dataclass(frozen=True, kw_only=True)
class ProbeTarget(Aim):
    """Base class of the targets of a probe.

    Attributes:
        probe: name of the probe.
    """

    probe: str

    def require_in(self, scene: Scene) -> None:
        """Raise CommandError for a scene without the probe."""
        require_named("probe", self.probe, scene.probes)


@dataclass(frozen=True, kw_only=True)
class Target(ProbeTarget):
    """Position of a probe; the goal is a position (3,) [m]."""

    unit = "m"

    @property
    def name(self) -> str:
        """Name of the probe."""
        return self.probe

    @property
    def output(self) -> str:
        """Name of the output: the position of the probe."""
        return f"probes.{self.probe}"

    def value(self, simulation: Simulation) -> Array:
        """Return the position (3,) [m] of the probe."""
        return simulation.probe_positions()[self.probe]

    def longest(self, simulation: Simulation, goal: Array, value: Array) -> float:
        """Return the longest motion of a probe [m]: `MOTION` times the body's size."""
        return MOTION * simulation.mesh.size


@dataclass(frozen=True, kw_only=True)
class OrientationTarget(ProbeTarget):
    """Orientation of a probe; the goal is a rotation vector (3,) [rad] relative to the undeformed body.

    The orientation is the rotation that best fits the corners of the cell around the probe, as on ``~/probe/<name>``.
    The axes select components of the remaining rotation vector, in the scene's frame.
    """

    unit = "rad"

    @property
    def name(self) -> str:
        """Name of the probe and its quantity."""
        return f"orientation of {self.probe}"

    @property
    def output(self) -> str:
        """Name of the output: the positions of all vertices, which include the corners of the probe's cell."""
        return "positions"

    def value(self, simulation: Simulation) -> Array:
        """Return the rotation vector (3,) [rad]."""
        now, rest = self._corners(simulation)
        return Rotation.align_vectors(now, rest)[0].as_rotvec()

    def longest(self, simulation: Simulation, goal: Array, value: Array) -> float:
        """Return the largest rotation [rad] in one change of the commands."""
        return TURN

    def missing(self, goal: Array, value: Array) -> Array:
        """Return the rotation vector (3,) [rad] from the present orientation to the goal."""
        return (Rotation.from_rotvec(goal) * Rotation.from_rotvec(value).inv()).as_rotvec()

    def derivative(self, simulation: Simulation, output: Array) -> Array:
        """Return the rotations (3, n) [rad] caused by motions ``output`` (3 v, n) [m] of the v vertices.

        Let x and X be the deformed and undeformed corners of the cell, relative to their means, and R the rotation that
        fits best. With y = R X and V = sum x y^T, motions dx of the corners cause a rotation w that satisfies
        (tr(V) I - V) w = sum y x dx (cross products).
        """
        now, rest = self._corners(simulation)
        turned = Rotation.align_vectors(now, rest)[0].apply(rest)
        stretch = now.T @ turned
        vertices = simulation.scene.probes[self.probe].corners[0]
        motions = output.reshape(-1, 3, output.shape[1])[vertices].transpose(0, 2, 1)
        moments = np.cross(turned[:, None, :], motions).sum(axis=0).T
        return np.linalg.solve(np.trace(stretch) * np.eye(3) - 0.5 * (stretch + stretch.T), moments)

    def _corners(self, simulation: Simulation) -> tuple[Array, Array]:
        """Return the deformed and undeformed corners (8 or 4, 3) [m] of the probe's cell, relative to their mean."""
        vertices = simulation.scene.probes[self.probe].corners[0]
        now, rest = simulation.positions[vertices], simulation.mesh.vertices[vertices]
        return now - now.mean(axis=0), rest - rest.mean(axis=0)


@dataclass(frozen=True, kw_only=True)
class ForceTarget(Aim):
    """Force of an obstacle or a handle on the body; the goal is a force (3,) [N].

    The force of an obstacle has a derivative only while there is contact. Bring the body into contact first.

    Attributes:
        contact: name of the obstacle or handle.
    """

    contact: str

    unit = "N"

    @property
    def name(self) -> str:
        """Name of the obstacle or handle and its quantity."""
        return f"force of {self.contact}"

    @property
    def output(self) -> str:
        """Name of the output: the reaction of the obstacle or handle."""
        return f"reactions.{self.contact}"

    def require_in(self, scene: Scene) -> None:
        """Raise CommandError for a scene without the obstacle or handle."""
        known = [handle.name for handle in scene.handles]
        if self.contact not in known:
            raise CommandError(f"no obstacle or handle {self.contact!r}; there are: {', '.join(known) or 'none'}")

    def value(self, simulation: Simulation) -> Array:
        """Return the force (3,) [N]."""
        if simulation.result is None:  # after a restore; this step moves nothing
            simulation.step()
        return simulation.result.reactions[self.contact][:3]

    def longest(self, simulation: Simulation, goal: Array, value: Array) -> float:
        """Return the larger of the magnitudes of the goal and of the present force [N]."""
        return max(float(np.linalg.norm(goal)), float(np.linalg.norm(value)), 1e-300)

    def obstacle(self, simulation: Simulation, value: Array) -> str:
        """Return a message if nothing touches the obstacle, or if points slip on it; empty otherwise."""
        if not value.any():
            return f"nothing touches {self.contact}: bring the body there first"
        touch = simulation.result.contacts.get(self.contact) if simulation.result else None
        if touch is None or not touch.slips.any():
            return ""
        return (
            f"points slip on {self.contact}, so that the force depends on the path: if the force has to fall, release "
            "the contact, and approach the goal from smaller forces"
        )

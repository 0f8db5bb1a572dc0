# SPDX-License-Identifier: Apache-2.0
"""The free bodies of a scene as entities of ``simulation_interfaces``: pose, velocity and bounds of each."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.mesh.mesh import MeshPart
from gdfe_ros.node.placement import Placement
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Simulation
from gdfe_ros.soft_places import fit_rigidly

OBJECT = 0
"""Category of every body here, ``CATEGORY_OBJECT``."""


class EntityMotion(NamedTuple):
    """Placement of an entity's frame, and linear and angular velocity (3,) [m/s] and [rad/s] of this frame."""

    place: Placement
    linear: NDArray[np.float64]
    angular: NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Thing:
    """A rigid body, or a soft body beside the scene's body.

    Attributes:
        name: its name.
        tags: ``rigid`` or ``soft``, and ``spawned`` if a request added it.
        vertices: its vertices in the simulation's state.
        rigid: the rigid body; None for a soft one.
        part: the soft body's mesh; None for a rigid one.
        inner: placement in the entity's frame of the rigid body's own frame.
    """

    name: str
    tags: tuple[str, ...]
    vertices: NDArray[np.int32]
    rigid: RigidBody | None = None
    part: MeshPart | None = None
    inner: Placement

    @property
    def description(self) -> str:
        """What it is, in a sentence."""
        if self.part is not None:
            return f"a soft body of {self.part.mesh.n_cells} cells"
        return f"a rigid body of {self.rigid.mass:g} kg, {type(self.rigid.form).__name__.lower()}"

    def place(self, simulation: Simulation) -> Placement:
        """Return the present placement of its frame; a soft body's is the rigid motion that fits its vertices best."""
        positions = simulation.state.positions + simulation.origin
        if self.rigid is not None:
            origin, axes = self.rigid.found(positions)
            return Placement(origin, Rotation.from_matrix(axes)) @ self.inner.inverse()
        origin, axes = fit_rigidly(self.part.mesh.vertices, positions[self.vertices])
        return Placement(origin, Rotation.from_matrix(axes))

    @property
    def rest(self) -> Placement:
        """Initial placement of the body's own frame."""
        if self.rigid is not None:
            return Placement(np.array(self.rigid.origin), Rotation.from_rotvec(self.rigid.turn))
        return Placement(self.part.at, Rotation.from_matrix(self.part.rotation))

    def motion(self, simulation: Simulation) -> EntityMotion:
        """Return its present placement and velocity."""
        place, positions = self.place(simulation), simulation.state.positions[self.vertices] + simulation.origin
        velocities = simulation.stepper.velocities(simulation.state)[self.vertices]
        arms = positions - positions.mean(axis=0)
        spread = np.vdot(arms, arms) * np.eye(3) - arms.T @ arms
        angular = np.linalg.solve(spread, np.cross(arms, velocities).sum(axis=0))
        linear = velocities.mean(axis=0) + np.cross(angular, place.origin - positions.mean(axis=0))
        return EntityMotion(place, linear, angular)

    def bounds(self, simulation: Simulation, frame: Placement) -> NDArray[np.float64]:
        """Return lowest and highest corner (2, 3) [m] of the box around it, along the axes of ``frame``."""
        positions = simulation.state.positions + simulation.origin
        points = positions[self.vertices]
        if self.rigid is not None:
            corners = np.array(list(product((-1.0, 1.0), repeat=3))) * self.rigid.form.half
            origin, axes = self.rigid.found(positions)
            points = origin + corners @ axes.T
        seen = frame.turn.inv().apply(points - frame.origin)
        return np.stack([seen.min(axis=0), seen.max(axis=0)])


def things_of(scene: Scene, spawned: dict[str, Placement]) -> list[Thing]:
    """Return the entities of a scene: rigid bodies, then soft bodies beside the scene's body.

    ``spawned`` are the names of spawned bodies, each with the placement in the entity's frame of the body's own frame.
    """
    found = [
        Thing(
            name=body.name, tags=_tags("rigid", body.name, spawned), vertices=body.vertices, rigid=body,
            inner=spawned.get(body.name, Placement()),
        )
        for body in scene.rigid_bodies
    ]  # fmt: skip
    for name in scene.soft_bodies:
        part = scene.mesh.parts[name]
        vertices = np.arange(part.first_vertex, part.first_vertex + part.mesh.n_vertices, dtype=np.int32)
        found.append(
            Thing(name=name, tags=_tags("soft", name, spawned), vertices=vertices, part=part, inner=Placement())
        )
    return found


def within(bounds: NDArray[np.float64], asked: Any) -> bool:
    """Return whether a box (2, 3) [m] overlaps a box or a sphere of ``simulation_interfaces/msg/Bounds``."""
    first, second = (np.array([each.x, each.y, each.z]) for each in asked.points)
    if asked.type == BOX:
        low, high = np.minimum(first, second), np.maximum(first, second)
        return bool((bounds[0] <= high).all() and (bounds[1] >= low).all())
    nearest = np.clip(first, bounds[0], bounds[1])
    return bool(np.linalg.norm(nearest - first) <= second[0])


EMPTY, BOX, SPHERE = 0, 1, 3
"""Types of bounds that a filter may have; 2, a convex hull, is not supported."""


def _tags(kind: str, name: str, spawned: Collection[str]) -> tuple[str, ...]:
    return (kind, "spawned") if name in spawned else (kind,)

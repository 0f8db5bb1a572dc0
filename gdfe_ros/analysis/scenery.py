# SPDX-License-Identifier: Apache-2.0
"""Things drawn in addition to the body: obstacles, rigid bodies, cables, chambers and contact forces."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.actuators import Cable, Chamber
from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.form import Plane, form_faces
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.mesh import HexMesh
from gdfe_ros.results.contacts import contact_points, places_and_forces

if TYPE_CHECKING:
    from gdfe_ros.scene import Scene
    from gdfe_ros.simulation import Simulation


def face_values(mesh: HexMesh, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values on the faces (f,) of the drawn surface, from ``values`` (m,) of the cells.

    The faces of cells have the values of their cells. A skin has many faces for each cell, and values of cells would
    jump between faces. Therefore each vertex of the mesh gets the mean value of its cells. Points of the skin are
    interpolated between vertices. A face has the mean value of its points, limited to the range of ``values``.
    """
    outside = mesh.outside
    if not outside.skin:
        return values[outside.cells]
    corners, sides, count = mesh.cells.ravel(), mesh.cells.shape[1], mesh.n_vertices
    sums = np.bincount(corners, weights=np.repeat(values, sides), minlength=count)
    at_vertices = sums / np.maximum(np.bincount(corners, minlength=count), 1)
    on_faces = outside.at(at_vertices)[outside.faces].mean(axis=1)
    return np.clip(on_faces, values.min(), values.max())


_POSE = (*(f"position.{axis}" for axis in "xyz"), *(f"orientation.{axis}" for axis in "xyzw"))
BEYOND = 0.25
"""Margin of a drawn plane around the points that it must cover, divided by the larger extent of the points."""


def faces_of(simulation: Simulation) -> list[NDArray[np.float64]]:
    """Return the faces (f, k, 3) [m] of each obstacle of a simulation, at its present pose."""
    obstacles = [handle for handle in simulation.scene.handles if isinstance(handle, Obstacle)]
    return [obstacle_faces(each, simulation.handle_pose(each.name), simulation.positions) for each in obstacles]


def find_recorded_faces(
    scene: Scene, samples: Mapping[str, Mapping[str, NDArray]], positions: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Return the faces (f, k, 3) [m] of each obstacle and rigid body of a scene, at its pose in a recorded step.

    Args:
        scene: the recorded scene.
        samples: arrays of a step, by topic and field. An obstacle whose pose is missing is at its initial pose.
        positions: positions of the body's vertices (n, 3) [m].
    """
    faces = []
    for obstacle in (handle for handle in scene.handles if isinstance(handle, Obstacle)):
        values = samples.get(pose_topic(obstacle))
        pose = Pose()
        if values is not None:
            x, y, z, qx, qy, qz, qw = (float(values[f"pose.{name}"][0]) for name in _POSE)
            pose = Pose((x, y, z), tuple(Rotation.from_quat([qx, qy, qz, qw]).as_rotvec()))
        faces.append(obstacle_faces(obstacle, pose, positions))
    return faces


def pose_topic(obstacle: Obstacle) -> str:
    """Return the topic, without the node's name, on which an obstacle's pose is published."""
    return f"{obstacle.section}/{obstacle.name}/pose"


def obstacle_faces(obstacle: Obstacle, pose: Pose, before: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the faces (f, k, 3) [m] of an obstacle at a ``pose``.

    A plane is one rectangle. It covers the projections of the points ``before`` (n, 3) [m] and a margin (`BEYOND`).
    """
    origin, axes = obstacle.frame(pose)
    if isinstance(obstacle.form, Plane):
        own = (before - origin) @ axes
        low, high = own[:, :2].min(axis=0), own[:, :2].max(axis=0)
        edge = BEYOND * (high - low).max()
        (a, b), (c, d) = low - edge, high + edge
        faces = np.array([[[a, b, 0.0], [c, b, 0.0], [c, d, 0.0], [a, d, 0.0]]])
    else:
        faces = form_faces(obstacle.form)
    return origin + faces @ axes.T


ARROW = 0.25
"""Length of the arrow for the largest force, divided by the size of the body."""
LEAST_FORCE = 0.02
"""Forces below this fraction of the largest force have no arrow."""
CONTACTS = "contacts"
"""Topic of the contact points, without the node's name."""


def _no_points() -> NDArray[np.float64]:
    return np.zeros((0, 3))


@dataclass(frozen=True, eq=False)
class Scenery:
    """The things around and inside a body, at one moment.

    Attributes:
        obstacles: faces (f, k, 3) [m] of each obstacle and rigid body.
        cables: points (k, 3) [m] of each cable, from end to end.
        chambers: faces (f, 4, 3) [m] of each chamber.
        places: positions of the contact points (c, 3) [m].
        forces: contact forces (c, 3) [N] on the soft body, or on the rigid body to which the point belongs.
    """

    obstacles: list[NDArray[np.float64]] = field(default_factory=list)
    cables: list[NDArray[np.float64]] = field(default_factory=list)
    chambers: list[NDArray[np.float64]] = field(default_factory=list)
    places: NDArray[np.float64] = field(default_factory=_no_points)
    forces: NDArray[np.float64] = field(default_factory=_no_points)

    @classmethod
    def of(cls, simulation: Simulation) -> Scenery:
        """Return the scenery of a simulation after its last step."""
        result = simulation.result
        points = None if result is None else contact_points(result.contacts)
        return cls(faces_of(simulation), *_inside(simulation.scene, simulation.positions), *_pushes(points))

    @classmethod
    def from_samples(
        cls, scene: Scene, samples: Mapping[str, Mapping[str, NDArray]], positions: NDArray[np.float64]
    ) -> Scenery:
        """Return the scenery of a recorded step.

        If a topic is missing, there are no forces, or the obstacle has its initial pose.

        Args:
            scene: the recorded scene.
            samples: arrays of a step, by topic and field.
            positions: positions of the body's vertices (n, 3) [m].
        """
        obstacles = find_recorded_faces(scene, samples, positions)
        return cls(obstacles, *_inside(scene, positions), *_pushes(samples.get(CONTACTS)))

    @staticmethod
    def topics(scene: Scene) -> Iterator[str]:
        """Yield the topics that `Scenery.from_samples` reads."""
        yield CONTACTS
        yield from (pose_topic(handle) for handle in scene.handles if isinstance(handle, Obstacle))


def force_arrows(
    places: NDArray[np.float64], forces: NDArray[np.float64], *, largest: float, size: float
) -> NDArray[np.float64]:
    """Return arrows (a, 2, 3) [m]; each ends at the point on which its force acts.

    Args:
        places: positions of the points (c, 3) [m].
        forces: forces on the points (c, 3) [N].
        largest: magnitude of force [N] whose arrow has the length `ARROW` times ``size``.
        size: size of the body [m].
    """
    some = np.linalg.norm(forces, axis=1) > LEAST_FORCE * largest
    ends = places[some]
    return np.stack([ends - forces[some] * (ARROW * size / (largest or 1.0)), ends], axis=1)


def _inside(
    scene: Scene, positions: NDArray[np.float64]
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Return the points of the cables, and the faces of the chambers."""
    cables = [each.points.at(positions) for each in scene.actuators if isinstance(each, Cable)]
    chambers = [each.at(positions)[each.quads] for each in scene.actuators if isinstance(each, Chamber)]
    return cables, chambers


def _pushes(points: NDArray | Mapping[str, NDArray] | None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return positions (c, 3) [m] and forces (c, 3) [N] of contact points with the fields of `contacts.POINT`."""
    return (_no_points(), _no_points()) if points is None else places_and_forces(points)

# SPDX-License-Identifier: Apache-2.0
"""Rigid and soft bodies as entities of ``simulation_interfaces``, requests to spawn one, and filters for lists."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.errors import ArmError, SceneError
from gdfe_ros.mesh.mesh import MeshPart
from gdfe_ros.node.command_messages import require_pose
from gdfe_ros.node.frames import Frames, Placement
from gdfe_ros.node.middleware.ros_types import interface_class
from gdfe_ros.node.refusals import Refused, ResultCode
from gdfe_ros.node.requests.services import SPAWNED, path_of
from gdfe_ros.scene.building.soft_bodies import parts_of
from gdfe_ros.scene.entity import LARGEST, Entity, read_entity
from gdfe_ros.scene.scene import Scene
from gdfe_ros.scene.schemas.scene_schema import NAME
from gdfe_ros.simulation import Simulation
from gdfe_ros.simulation_parts.soft_places import fit_rigidly
from gdfe_ros.untrusted.regular_file import read_text

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
        name: name of the body.
        tags: ``rigid`` or ``soft``, and ``spawned`` if a request added it.
        vertices: ids of the body's vertices in the simulation's state.
        rigid: the rigid body; None for a soft one.
        part: the soft body's mesh; None for a rigid one.
        inner: placement of the rigid body's own frame in the entity's frame.
    """

    name: str
    tags: tuple[str, ...]
    vertices: NDArray[np.int32]
    rigid: RigidBody | None = None
    part: MeshPart | None = None
    inner: Placement

    @property
    def description(self) -> str:
        """Kind and size of the body, for users."""
        if self.part is not None:
            return f"a soft body of {self.part.mesh.n_cells} cells"
        return f"a rigid body of {self.rigid.mass:g} kg, {type(self.rigid.form).__name__.lower()}"

    def place(self, simulation: Simulation) -> Placement:
        """Return the present placement of the entity's frame; a soft body's is the best rigid fit to its vertices."""
        positions = simulation.state.positions + simulation.origin
        if self.rigid is not None:
            origin, axes = self.rigid.find_frame(positions)
            return Placement(origin, Rotation.from_matrix(axes)) @ self.inner.inverse()
        origin, axes = fit_rigidly(self.part.mesh.vertices, positions[self.vertices])
        return Placement(origin, Rotation.from_matrix(axes))

    @property
    def rest(self) -> Placement:
        """Initial placement of the body's own frame."""
        if self.rigid is not None:
            return rest_place(self.rigid)
        return Placement(self.part.at, Rotation.from_matrix(self.part.rotation))

    def motion(self, simulation: Simulation) -> EntityMotion:
        """Return the body's present placement and velocity."""
        place, positions = self.place(simulation), simulation.state.positions[self.vertices] + simulation.origin
        velocities = simulation.stepper.velocities(simulation.state)[self.vertices]
        arms = positions - positions.mean(axis=0)
        spread = np.vdot(arms, arms) * np.eye(3) - arms.T @ arms
        angular = np.linalg.solve(spread, np.cross(arms, velocities).sum(axis=0))
        linear = velocities.mean(axis=0) + np.cross(angular, place.origin - positions.mean(axis=0))
        return EntityMotion(place, linear, angular)

    def bounds(self, simulation: Simulation, frame: Placement) -> NDArray[np.float64]:
        """Return lowest and highest corner (2, 3) [m] of the box around the body, along the axes of ``frame``."""
        positions = simulation.state.positions + simulation.origin
        points = positions[self.vertices]
        if self.rigid is not None:
            corners = np.array(list(product((-1.0, 1.0), repeat=3))) * self.rigid.form.half
            origin, axes = self.rigid.find_frame(positions)
            points = origin + corners @ axes.T
        seen = frame.turn.inv().apply(points - frame.origin)
        return np.stack([seen.min(axis=0), seen.max(axis=0)])


def rest_place(body: Obstacle) -> Placement:
    """Return the initial placement of the frame of an obstacle or rigid body."""
    return Placement(np.array(body.origin), Rotation.from_rotvec(body.turn))


def things_of(scene: Scene, spawned: dict[str, Placement]) -> list[Thing]:
    """Return the entities of a scene: rigid bodies, then soft bodies beside the scene's body.

    ``spawned`` maps the name of each spawned body to the placement of the body's own frame in the entity's frame.
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


LONGEST = 60
"""Largest number of letters of a body's name; the name becomes a part of names of topics."""


class EntityRequest:
    """A request to spawn a body, of any version of ``simulation_interfaces``.

    Args:
        request: the request.

    Raises:
        Refused: the request asks for a namespace, or its resource is too large.

    Attributes:
        pose: initial pose, with the frame in its header.
    """

    def __init__(self, request: Any) -> None:
        resource = getattr(request, "entity_resource", request)  # version 2.1 has a message of its own for it
        if request.entity_namespace:
            text = f"entity_namespace is {request.entity_namespace!r}; allowed: empty, the topics of a body are below "
            raise Refused(ResultCode.NAMESPACE_INVALID, f"{text}this node's name")
        if (size := len(resource.resource_string)) > LARGEST:
            text = f"resource_string has {size} characters; allowed: up to {LARGEST}"
            raise Refused(ResultCode.PARSE_ERROR, text)
        self._name, self._renames, self.pose = request.name, request.allow_renaming, request.initial_pose
        self._uri, self._text = resource.uri, resource.resource_string

    def entity(self) -> Entity:
        """Return the body that the resource describes.

        Raises:
            Refused: there is no resource, it cannot be read, or it has defects.
        """
        if not (self._uri or self._text):
            raise Refused(ResultCode.NO_RESOURCE, "uri and resource_string are empty; one of them must state the body")
        try:
            return read_entity(_read(self._uri) if self._uri else self._text, where=self._uri or "resource_string")
        except (ArmError, SceneError) as error:
            raise Refused(ResultCode.PARSE_ERROR, str(error)) from error

    def unique_name(self, entity: Entity, taken: set[str]) -> str:
        """Return a name for the body that is not in ``taken``.

        Raises:
            Refused: there is no name, the name is invalid, or it is taken and must not be changed.
        """
        name = self._name or entity.name or ("body" if self._renames else "")
        if not NAME.fullmatch(name) or len(name) > LONGEST:
            text = f"name is {name[: LONGEST + 1]!r}; allowed: up to {LONGEST} letters, digits and _, a letter first"
            raise Refused(ResultCode.NAME_INVALID, text)
        if name not in taken:
            return name
        if not self._renames:
            text = f"the name {name!r} is taken; remedy: another one, or allow_renaming"
            raise Refused(ResultCode.NAME_NOT_UNIQUE, text)
        number = 2
        while f"{name}_{number}" in taken:
            number += 1
        return f"{name}_{number}"


def placement_of(stamped: Any, frames: Frames) -> Placement:
    """Return the placement in the node's frame of a message with a ``header`` and a ``pose``.

    Raises:
        Refusal: a number is not finite, or the quaternion is not of unit length.
        Refused: the frame is not known.
    """
    frame = stamped.header.frame_id
    place, inner = frames.place(frame), require_pose(stamped.pose)
    if place is None:
        text = f"header.frame_id is {frame!r}; allowed: empty, {frames.frame_id!r}, or a frame connected to it on /tf"
        raise Refused(ResultCode.INVALID_POSE, text)
    return place @ inner


def _read(uri: str) -> str:
    """Return the text of the file at a URI ``file:///path`` or at a path.

    Raises:
        Refused: the text is neither, or the file cannot be read.
    """
    path = path_of(uri, SPAWNED, code=ResultCode.UNSUPPORTED_FORMAT)
    try:
        return read_text(path, most=LARGEST)
    except (OSError, ValueError) as error:  # no regular file, no text, or no path
        reason = getattr(error, "strerror", None) or error
        raise Refused(ResultCode.PARSE_ERROR, f"uri {uri[:200]!r} cannot be read as text: {reason}") from error


def inner_of(scene: Scene, name: str, outer: Placement) -> Placement:
    """Return the placement of a new body's own frame in the frame ``outer``, in which the body was spawned."""
    body = next((each for each in scene.rigid_bodies if each.name == name), None)
    return Placement() if body is None else outer.inverse() @ rest_place(body)


def remark_on(scene: Scene, entity: Any) -> str:
    """Return a remark on a soft body that would pass through the others; else an empty text."""
    if entity.materials is None or scene.self_contact is not None:
        return ""
    return "soft bodies pass through each other, because the scene has no `self_contact`"


def names_of(scene: Scene) -> set[str]:
    """Return the names in a scene that a new body must not have."""
    items = (*scene.handles, *scene.actuators, *scene.loads, *scene.fibres)
    return {item.name for item in items} | set(parts_of(scene.mesh))


_REPEATED_GROUP = re.compile(r"(?<!\\)\)[*+{]")


_REPETITION = re.compile(r"[*+?{]")


_MOST_REPETITIONS, _LONGEST_FILTER = 3, 100
"""Largest number of repetitions, and of characters, in an expression that filters names: more could take hours."""


_ALL = 1
"""Mode of a filter that needs all tags."""


def list_poses(scene: Scene) -> Iterator[tuple[str, str, Placement]]:
    """For each handle, obstacle and probe, yield its name, its kind, and its initial placement in the node's frame."""
    for each in scene.handles:
        if isinstance(each, Obstacle) and not isinstance(each, RigidBody):
            yield each.name, "obstacle", rest_place(each)
        elif not isinstance(each, RigidBody):
            yield each.name, "handle", Placement(each.centre(scene.mesh.vertices))
    for name, point in scene.probes.items():
        yield name, "probe", Placement(point.at(scene.mesh.vertices)[0])


def has_tags(tags: tuple[str, ...], asked: Any) -> bool:
    """Return whether a body's tags pass a ``TagsFilter``.

    The filter requires one of its own tags or, in the mode `_ALL`, all of them. Without tags it passes every body.
    """
    wanted = set(asked.tags)
    return not wanted or (wanted <= set(tags) if asked.filter_mode == _ALL else bool(wanted & set(tags)))


def name_filter(pattern: str) -> Callable[[str], object]:
    """Return a function that tells whether a name matches an expression.

    Raises:
        Refused: the pattern is no regular expression, or its search could take too long.
    """
    if why := _too_slow(pattern):
        raise Refused(ResultCode.UNSUPPORTED, f"filters.filter {pattern[:_LONGEST_FILTER]!r} {why}")
    try:
        return re.compile(pattern).search
    except re.error as error:
        raise Refused(ResultCode.FAILED, f"filters.filter {pattern!r} is no regular expression: {error}") from error


def require_bounds(bounds: Any) -> None:
    """Raise `Refused` unless the bounds of a filter are empty, or a box or sphere with two finite points."""
    if bounds.type == EMPTY:
        return
    if bounds.type not in (BOX, SPHERE):
        text = f"filters.bounds.type is {bounds.type}; allowed: {EMPTY} (none), {BOX} (box), {SPHERE} (sphere)"
        raise Refused(ResultCode.UNSUPPORTED, text)
    numbers = [value for each in bounds.points for value in (each.x, each.y, each.z)]
    if len(bounds.points) != 2 or not np.isfinite(numbers).all():
        text = f"filters.bounds has {len(bounds.points)} points; allowed: two, of finite numbers"
        raise Refused(ResultCode.FAILED, text)


def _too_slow(pattern: str) -> str:
    """Return a text that says why the search for an expression could take too long; empty if it cannot."""
    if len(pattern) > _LONGEST_FILTER:
        return f"has {len(pattern)} characters; allowed: up to {_LONGEST_FILTER}"
    if _REPEATED_GROUP.search(pattern):
        return "repeats a group, which is not supported"
    if (count := len(_REPETITION.findall(pattern))) > _MOST_REPETITIONS:
        return f"has {count} repetitions; allowed: up to {_MOST_REPETITIONS}"
    return ""


def pose_from_rest(thing: Thing, place: Placement) -> Pose:
    """Return the pose relative to rest of a body whose own frame has the placement ``place``."""
    rest = thing.rest
    return Pose(tuple(place.origin - rest.origin), tuple((place.turn * rest.turn.inv()).as_rotvec()))


def new_message(sequence: str) -> Any:
    """Return a new message of the type of a field like ``sequence<simulation_interfaces/SpawnResult>``."""
    return interface_class(f"simulation_interfaces/msg/{sequence.rpartition('/')[2].rstrip('>')}")()

# SPDX-License-Identifier: Apache-2.0
"""Coordinate frames of a body and frames on /tf: names, placements, and the chain of transforms between two of them."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message
from scipy.spatial.transform import Rotation

from gdfe_ros.arms.dynamics import LinkFrame
from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.constraints.obstacle import ArmLink
from gdfe_ros.node.interface import TopicSpec, topics
from gdfe_ros.node.middleware.managed import ManagedNode
from gdfe_ros.node.middleware.ros_types import interface_class, subscribe
from gdfe_ros.node.refusals import Freshness, Reason, Refusal, require_place, require_small
from gdfe_ros.recording.message_tables import material_pose
from gdfe_ros.recording.step import Step
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation_parts.soft_places import fit_rigidly


@dataclass(frozen=True, eq=False)
class Placement:
    """Placement of one frame in another: origin (3,) [m] and rotation of its axes."""

    origin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    turn: Rotation = field(default_factory=Rotation.identity)

    @classmethod
    def of(cls, translation: Any, rotation: Any) -> Placement:
        """Return the placement with the translation x, y, z [m] and the rotation, a quaternion, of a message."""
        turn = Rotation.from_quat([rotation.x, rotation.y, rotation.z, rotation.w])
        return cls(np.array([translation.x, translation.y, translation.z]), turn)

    def __matmul__(self, inner: Placement) -> Placement:
        """Return ``inner``, a placement in this frame, as a placement in this frame's parent."""
        return Placement(self.origin + self.turn.apply(inner.origin), self.turn * inner.turn)

    def inverse(self) -> Placement:
        """Return the placement of the parent frame in this frame."""
        back = self.turn.inv()
        return Placement(-back.apply(self.origin), back)


_UNREAD = 2000
"""Largest number of unread messages of /tf; older ones are dropped. A moving frame is published again long before so
many messages arrive.
"""
_MOST_FRAMES = 10_000
"""Largest number of frames of other nodes; transforms of further ones are refused."""
_DEEPEST = 1000
"""A frame with more ancestors than this number is part of a cycle."""
_SHOWN = 80
"""Largest number of characters of a frame's name that a refusal shows."""
_UNIT_SLACK = 1e-2
"""Largest deviation of a quaternion's length from 1, as in tf2."""


class Transforms:
    """Subscribes to /tf and /tf_static; for each frame the transform with the latest stamp is used.

    A transform is ignored, and counted as a refused command, in four cases: a number is not finite, the quaternion is
    not of unit length, the stamp is older or farther ahead than allowed for a command, or `_MOST_FRAMES` are known.

    Args:
        node: node of the subscriptions.
        heard: function that is called after each message.
        now: function that returns the time on the clock of the stamps [ns].
        limits: parameters ``command_max_age`` and ``command_max_lead`` [s] by name.
        refuse: function that receives the topic and the refusal of a refused transform.
    """

    def __init__(
        self,
        node: ManagedNode,
        heard: Callable[[], object],
        *,
        now: Callable[[], int],
        limits: Mapping[str, Any],
        refuse: Callable[[str, Refusal], None],
    ) -> None:
        self._node, self._heard, self._now, self._limits, self._refuse = node, heard, now, limits, refuse
        self._freshness = Freshness()
        self._own: Collection[str] = ()
        self._unread: dict[TopicSpec, deque[tuple[bytes, int]]] = {topics.TF_STATIC: deque(), topics.TF: deque()}
        self._parents: dict[str, tuple[str, Placement]] = {}
        self._lock = threading.Lock()
        self._subscriptions = [
            subscribe(node, spec, partial(self._keep, spec), raw=True) for spec in (topics.TF, topics.TF_STATIC)
        ]

    def destroy(self) -> None:
        """Remove the subscriptions from the graph."""
        self._heard = lambda: None
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        self._subscriptions = []

    def list_received(self) -> list[str]:
        """Return the names of the received frames, sorted."""
        with self._lock:
            self._read()
            return sorted({*self._parents, *(parent for parent, _ in self._parents.values())})

    def find(self, source: str, target: str, own: Mapping[str, tuple[str, Placement]]) -> Placement | None:
        """Return the placement of the frame ``source`` in the frame ``target``; None if no transforms connect them.

        Args:
            source: name of the frame to place.
            target: name of the reference frame.
            own: dict from name to parent, and placement in the parent, of each frame that the node computes itself.
        """
        with self._lock:
            self._own = own.keys()
            self._read()
            parents = {**self._parents, **own}
        chains = _chain_up(source, parents), _chain_up(target, parents)
        common = next((frame for frame in chains[0] if frame in chains[1]), None)
        return None if common is None else chains[1][common].inverse() @ chains[0][common]

    def reset(self) -> None:
        """Drop the stored stamps, so that the next stamp of each frame may be earlier than its last one."""
        with self._lock:
            self._freshness.reset()

    def _keep(self, spec: TopicSpec, data: bytes) -> None:
        """Store a message without reading it: a robot publishes thousands of transforms a second; few are needed."""
        try:
            require_small(data)
        except Refusal as refusal:
            self._refuse(self._node.resolve_topic_name(spec.name), refusal)
            return
        waiting = self._unread[spec]
        waiting.append((data, self._now()))
        if len(waiting) > _UNREAD:
            with self._lock:
                if spec is topics.TF:
                    waiting.popleft()
                else:  # unlike moving frames, these are not published again
                    self._read()
        self._heard()

    def _read(self) -> None:
        """Read the stored messages; needs the lock."""
        kind = interface_class(topics.TF.type)
        for spec, waiting in self._unread.items():
            while waiting:
                data, arrived = waiting.popleft()
                for each in deserialize_message(data, kind).transforms:
                    if each.child_frame_id in self._own:  # published by this node itself
                        continue
                    try:
                        self._store(each, arrived, moving=spec is topics.TF)
                    except Refusal as refusal:
                        if refusal.reason is not Reason.OUT_OF_ORDER:
                            text = f"frame {each.child_frame_id[:_SHOWN]!r}: {refusal}"
                            self._refuse(self._node.resolve_topic_name(spec.name), Refusal(refusal.reason, text))

    def _store(self, stamped: Any, arrived: int, *, moving: bool) -> None:
        """Store a transform that arrived at the time ``arrived`` [ns]; check the stamp of a moving frame.

        Raises:
            Refusal: a number is not finite, the quaternion is not of unit length, the stamp is too old, ahead, or
                before the frame's last stamp, or `_MOST_FRAMES` are known.
        """
        origin, turn = stamped.transform.translation, stamped.transform.rotation
        require_place(origin, turn, _UNIT_SLACK, ("translation", "rotation"))
        if stamped.child_frame_id not in self._parents and len(self._parents) >= _MOST_FRAMES:
            raise Refusal(Reason.QUEUE_FULL, f"{_MOST_FRAMES} frames are known; further ones are refused")
        if moving:
            ages = {"max_age": self._limits["command_max_age"], "max_lead": self._limits["command_max_lead"]}
            self._freshness.check([stamped.child_frame_id], stamped.header.stamp, now=arrived, **ages)
        self._parents[stamped.child_frame_id] = stamped.header.frame_id, Placement.of(origin, turn)


def _chain_up(frame: str, parents: Mapping[str, tuple[str, Placement]]) -> dict[str, Placement]:
    """Return a frame's placement in itself and in each of its ancestors, nearest first, by name."""
    chain = {frame: Placement()}
    while frame in parents and parents[frame][0] not in chain and len(chain) < _DEEPEST:
        parent, placement = parents[frame]
        chain[parent] = placement @ chain[frame]
        frame = parent
    return chain


class Frames:
    """The coordinate frames of a body, and transforms from other frames to them.

    The name of every frame begins with the part of ``frame_id`` before its last slash, so that frames of several robots
    differ: with ``left/base_link`` the handle ``tip`` has the frame ``left/tip``.

    Args:
        frame_id: name of the node's own frame; the coordinates of the rest shape refer to it.
        scene: scene of the body; None if only names are needed.
        transforms: transforms of other frames; None if none are known.

    Attributes:
        frame_id: name of the node's own frame.
        last: function that returns the last step, or None.
    """

    def __init__(self, frame_id: str, scene: Scene | None = None, transforms: Transforms | None = None) -> None:
        self.frame_id, self._scene, self.transforms = frame_id, scene, transforms
        self._prefix = "/".join([*frame_id.split("/")[:-1], ""])
        self._links = {} if scene is None else self._parents_of_links(scene)
        self.last: Callable[[], Step | None] = lambda: None

    def full_name(self, name: str) -> str:
        """Return the full name of one of the node's own frames, with the part before the last slash of ``frame_id``.

        ``name`` is one of:

        - empty: the node's own frame.
        - ``<handle>_rest``: at the rest centre of a handle or obstacle; its pose and target refer to this frame.
        - ``<handle>_centre``: at the present centre, with the node's axes; the wrench refers to this frame.
        - ``<handle>``: moves and rotates with the handle or obstacle.
        - ``<probe>_probe``: moves and rotates with a material point.
        - ``<probe>_imu``: moves with a material point, and rotates with the cell around it.
        - ``<sensor>_sensor``: at the present centre of a contact sensor, with the node's axes.
        - ``<mesh>_mesh``: moves and rotates with one of several meshes, by the best fit to the mesh's vertices.
        - the name of an arm's link.
        """
        return f"{self._prefix}{name}" if name else self.frame_id

    def rest(self, handle: str) -> str:
        """Return the name of the frame at the rest centre of a handle or obstacle."""
        return self.full_name(f"{handle}_rest")

    @property
    def moving(self) -> list[str]:
        """Names of the moving frames, in the order of ``places``."""
        scene = self._scene
        handles = [name for handle in self._framed for name in (f"{handle.name}_centre", handle.name)]
        probes = [f"{name}_probe" for name in scene.probes]
        units = [f"{name}_imu" for name in scene.probes if scene.dynamics]
        parts = [*(f"{name}_sensor" for name in scene.sensors), *(f"{name}_mesh" for name in scene.mesh.parts)]
        return list(map(self.full_name, [*handles, *probes, *units, *parts, *self._links]))

    @property
    def parents(self) -> list[str]:
        """Names of the parents of the ``moving`` frames: a link's parent link, and for all others the node's frame."""
        own = len(self.moving) - len(self._links)
        return [self.frame_id] * own + list(map(self.full_name, self._links.values()))

    def remarks(self) -> list[str]:
        """Return a text for each root link of an arm that has the name of the node's frame, but lies elsewhere."""
        found = []
        for arm in self._scene.arms:
            root, base = arm.dynamics.description.root, arm.dynamics.base
            if self.full_name(root) == self.frame_id and (
                base.origin.any() or not np.array_equal(base.axes, np.eye(3))
            ):
                text = f"link {root!r} of arm {arm.name!r} has the name of the node's frame (frame_id)"
                found.append(f"{text}, but another place, and is not on /tf; remedy: another frame_id, e.g. world")
        return found

    def _parents_of_links(self, scene: Scene) -> dict[str, str]:
        """Return a dict from link to parent link; the parent's name is empty if it is the node's frame.

        A link with the name of the node's frame is left out: a frame cannot be its own parent.
        """
        found = {}
        for arm in scene.arms:
            joints = arm.dynamics.description.parents
            for link in arm.dynamics.description.links:
                if self.full_name(link) != self.frame_id:
                    parent = joints[link].parent if link in joints else ""
                    found[link] = "" if self.full_name(parent) == self.frame_id else parent
        return found

    @property
    def _framed(self) -> list[Handle]:
        """Handles with a frame of their own. Pieces of an arm's link have none; they move with the link's frame."""
        return [handle for handle in self._scene.handles if not isinstance(handle, ArmLink)]

    def rests(self) -> dict[str, Placement]:
        """Return a dict from frame name to placement, for the frames at the rest centres of handles and obstacles."""
        vertices = self._scene.mesh.vertices
        return {self.rest(handle.name): Placement(handle.centre(vertices)) for handle in self._framed}

    def places(self, step: Step) -> list[Placement]:
        """Return the placements of the moving frames in their ``parents`` after a step, in the order of ``moving``."""
        rest, positions, units = self._scene.mesh.vertices, step.result.positions, step.imus()
        found = [place for _, place in self._place_handles(step.poses)]
        probes = {name: material_pose(point, rest, positions) for name, point in self._scene.probes.items()}
        points = [(np.array(pose.translation), name) for name, pose in probes.items()]
        found += [Placement(origin, Rotation.from_rotvec(probes[name].rotation)) for origin, name in points]
        found += [Placement(origin, units[name].orientation) for origin, name in points if name in units]
        found += [Placement(sensor.centre(positions)) for sensor in self._scene.sensors.values()]
        for part in self._scene.mesh.parts.values():
            vertices = slice(part.first_vertex, part.first_vertex + part.mesh.n_vertices)
            origin, axes = fit_rigidly(part.mesh.vertices, positions[vertices])
            found.append(Placement(origin, Rotation.from_matrix(axes)))
        return found + self._place_links(step.links)

    def _place_links(self, links: Mapping[str, LinkFrame]) -> list[Placement]:
        """Return the placements of links in their parents."""
        if not self._links:
            return []
        still = LinkFrame(np.zeros(3), np.eye(3))
        pairs = [(links[name], links[parent] if parent else still) for name, parent in self._links.items()]
        origins = [parent.axes.T @ (link.origin - parent.origin) for link, parent in pairs]
        turns = Rotation.from_matrix(np.stack([parent.axes.T @ link.axes for link, parent in pairs]))
        return list(map(Placement, origins, turns))

    def place(self, frame: str) -> Placement | None:
        """Return the placement of a named frame in the node's frame; None if no transforms connect the two."""
        if frame in ("", self.frame_id):
            return Placement()
        return self.transforms and self.transforms.find(frame, self.frame_id, self._own())

    def relative(self, frame: str, handle: str) -> Placement | None:
        """Return the placement of a command's frame in a handle's rest frame; None if no transform is needed.

        Raises:
            Refusal: no transforms connect the two frames.
        """
        rest = self.rest(handle)
        if frame in ("", self.frame_id, rest):
            return None
        if self.transforms is None:
            text = (
                f"header.frame_id is {frame!r}; allowed: empty, {self.frame_id!r} or {rest!r}, because a target is "
                "relative to the rest pose in these axes; remedy: transform it before you send it, or install tf2_msgs"
            )
            raise Refusal(Reason.FRAME, text)
        found = self.transforms.find(frame, rest, self._own())
        if found is None:
            text = (
                f"header.frame_id is {frame!r}; allowed: empty, {self.frame_id!r}, {rest!r}, or a frame connected "
                f"to them on /tf; frames on /tf: {', '.join(self.transforms.list_received()) or 'none'}"
            )
            raise Refusal(Reason.FRAME, text)
        return found

    def _own(self) -> dict[str, tuple[str, Placement]]:
        """Return a dict from frame name to parent and placement, for handles, obstacles and contact sensors."""
        last = self.last()
        now, poses = (self._scene.mesh.vertices, {}) if last is None else (last.result.positions, last.poses)
        places = dict(self._place_handles(poses))
        places |= {f"{name}_sensor": Placement(each.centre(now)) for name, each in self._scene.sensors.items()}
        own = self.rests() | {self.full_name(name): place for name, place in places.items()}
        return {name: (self.frame_id, place) for name, place in own.items()}

    def _place_handles(self, poses: Mapping[str, Pose]) -> Iterator[tuple[str, Placement]]:
        """Yield name and placement in the node's frame, for both frames of each handle and obstacle.

        ``poses`` are relative to rest, by name; a handle without a pose is at rest.
        """
        for handle in self._framed:
            pose = poses.get(handle.name, Pose())
            origin = handle.centre(self._scene.mesh.vertices) + pose.translation
            yield f"{handle.name}_centre", Placement(origin)
            yield handle.name, Placement(origin, Rotation.from_rotvec(pose.rotation))

# SPDX-License-Identifier: Apache-2.0
"""Frames on /tf: their places, and the chain of transforms between two of them."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message
from scipy.spatial.transform import Rotation

from gdfe_ros.node.drive import Settings
from gdfe_ros.node.interface import TopicSpec, topics
from gdfe_ros.node.managed import ManagedNode
from gdfe_ros.node.refusals import Freshness, Reason, Refusal, require_place, require_small
from gdfe_ros.node.ros_types import installed, interface_class, qos_profile


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
        """Return the placement in this frame's parent of a frame whose placement in this frame is ``inner``."""
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

    A transform is ignored, and counted as a refused command, in three cases: a number is not finite, the quaternion is
    not of unit length, or the stamp is older or farther ahead than allowed for a command.

    Args:
        node: node of the subscriptions.
        heard: function that is called after each message.
        now: function that returns the time on the clock of the stamps [ns].
        limits: parameters ``command_max_age`` and ``command_max_lead`` [s] by name.
        refuse: function that receives topic and frame of a transform, and its refusal.
    """

    def __init__(
        self,
        node: ManagedNode,
        heard: Callable[[], object],
        *,
        now: Callable[[], int],
        limits: Settings,
        refuse: Callable[[str, Refusal], None],
    ) -> None:
        self._node, self._heard, self._now, self._limits, self._refuse = node, heard, now, limits, refuse
        self._freshness = Freshness()
        self._own: Collection[str] = ()
        self._unread: dict[TopicSpec, deque[tuple[bytes, int]]] = {topics.TF_STATIC: deque(), topics.TF: deque()}
        self._parents: dict[str, tuple[str, Placement]] = {}
        self._lock = threading.Lock()
        self._subscriptions = [
            node.create_subscription(
                interface_class(spec.type), spec.name, partial(self._keep, spec), qos_profile(spec.delivery), raw=True
            )
            for spec in (topics.TF, topics.TF_STATIC)
        ]

    def destroy(self) -> None:
        """Remove the subscriptions from the graph."""
        self._heard = lambda: None
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        self._subscriptions = []

    def known(self) -> list[str]:
        """Return the names of the received frames, sorted."""
        with self._lock:
            self._read()
            return sorted({*self._parents, *(parent for parent, _ in self._parents.values())})

    def find(self, source: str, target: str, own: Mapping[str, tuple[str, Placement]]) -> Placement | None:
        """Return the placement of the frame ``source`` in the frame ``target``; None if no transforms connect them.

        Args:
            source: name of the frame to place.
            target: name of the reference frame.
            own: dict from name of a frame that the node computes itself to its parent and its placement there.
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
            self._refuse(spec.name, refusal)
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
                        self._take(each, arrived, moving=spec is topics.TF)
                    except Refusal as refusal:
                        if refusal.reason is not Reason.OUT_OF_ORDER:
                            self._refuse(f"{spec.name}, frame {each.child_frame_id[:_SHOWN]!r},", refusal)

    def _take(self, told: Any, arrived: int, *, moving: bool) -> None:
        """Store a transform that arrived at a time [ns]; the stamp of a moving frame is checked.

        Raises:
            Refusal: a number is not finite, the quaternion is not of unit length, or the stamp is too old, ahead, or
                before the frame's last stamp.
        """
        origin, turn = told.transform.translation, told.transform.rotation
        require_place(origin, turn, _UNIT_SLACK, ("translation", "rotation"))
        if told.child_frame_id not in self._parents and len(self._parents) >= _MOST_FRAMES:
            raise Refusal(Reason.QUEUE_FULL, f"{_MOST_FRAMES} frames are known; further ones are refused")
        if moving:
            ages = {"max_age": self._limits["command_max_age"], "max_lead": self._limits["command_max_lead"]}
            self._freshness.check([told.child_frame_id], told.header.stamp, now=arrived, **ages)
        self._parents[told.child_frame_id] = told.header.frame_id, Placement.of(origin, turn)


def _chain_up(frame: str, parents: Mapping[str, tuple[str, Placement]]) -> dict[str, Placement]:
    """Return a dict from a frame itself and each of its ancestors, nearest first, to the frame's placement there."""
    chain = {frame: Placement()}
    while frame in parents and parents[frame][0] not in chain and len(chain) < _DEEPEST:
        parent, placement = parents[frame]
        chain[parent] = placement @ chain[frame]
        frame = parent
    return chain


def transforms_installed() -> bool:
    """Return whether the messages of /tf are installed."""
    return installed(topics.TF.type)

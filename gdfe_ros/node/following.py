# SPDX-License-Identifier: Apache-2.0
"""Handles and obstacles that follow a leader: the pose on a topic, or a frame on /tf."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from geometry_msgs.msg import PoseStamped

from gdfe_ros.command import require_movable
from gdfe_ros.constraints import Handle
from gdfe_ros.errors import CommandError, GdfeError
from gdfe_ros.node.command_messages import placed_order, require_pose
from gdfe_ros.node.frames import Frames, Placement
from gdfe_ros.node.orders import PoseOrder
from gdfe_ros.node.refusals import Reason, Refusal
from gdfe_ros.node.run import Run
from gdfe_ros.scene.scene import Scene


@dataclass(frozen=True)
class Leader:
    """The leader of a handle. Either ``topic`` or ``frame`` is its name; the other attribute is empty."""

    handle: Handle
    topic: str = ""
    frame: str = ""

    def __str__(self) -> str:
        return f"topic {self.topic}" if self.topic else f"frame {self.frame}"

    @property
    def key(self) -> str:
        """Key of the handle's input in ``command_set`` and in bags."""
        return f"{self.handle.section}/{self.handle.name}/follow"


def leaders_of(entries: Iterable[str], scene: Scene, *, listening: bool) -> dict[str, Leader]:
    """Return the leaders in the parameter ``follow``: dict from the name of a handle or obstacle to its leader.

    Args:
        entries: entries of the parameter.
        scene: scene with the handles and obstacles.
        listening: whether tf2_msgs is installed, so that the node receives /tf.

    Raises:
        GdfeError: an entry is malformed, names no movable handle or obstacle, names the same handle as another entry,
            or names a frame while tf2_msgs is not installed.
    """
    handles, found = {handle.name: handle for handle in scene.handles}, {}
    for entry in entries:
        name, _, leader = entry.partition("=")
        kind, _, source = leader.partition(":")
        start = f"parameter follow holds {entry!r}"
        if kind not in ("topic", "frame") or not source:
            raise GdfeError(f"{start}; allowed: handle=topic:/name or handle=frame:name")
        if name not in handles:
            raise GdfeError(f"{start}; the scene has no handle {name!r}, but {', '.join(handles) or 'none'}")
        try:
            require_movable(handle := handles[name])
        except CommandError as error:
            raise GdfeError(f"{start}; {error}") from error
        if kind == "frame" and not listening:
            raise GdfeError(f"{start}; frames need tf2_msgs, which is not installed: follow a topic, or install it")
        if name in found:
            raise GdfeError(f"{start}; {handle.noun} {name!r} follows {found[name]} already")
        found[name] = Leader(handle, **{kind: source})
    return found


def refuse_followed(message: object, leader: Leader) -> PoseOrder:
    """Refuse a command to a handle that follows a leader: always raise a ``Refusal``."""
    handle = leader.handle
    raise Refusal(Reason.FOLLOWS, f"{handle.noun} {handle.name!r} follows {leader} and takes no commands")


def followed_order(message: PoseStamped, leader: Leader, *, size: float, frames: Frames) -> PoseOrder:
    """Return the order for a handle from a message on its leader's topic; ``size`` is the body's size [m].

    Raises:
        Refusal: no transforms lead to the header's frame, a number is not finite, the quaternion is not of unit
            length, or the pose is farther from rest than ten times the body's size.
    """
    place = frames.place(message.header.frame_id)
    if place is None:
        raise Refusal(Reason.FRAME, f"no transforms lead from {message.header.frame_id!r} to {frames.frame_id!r}")
    return placed_order(leader.handle, place @ require_pose(message.pose), size=size, frames=frames)


class Followers:
    """Commands handles that follow a frame on /tf.

    Args:
        leaders: leaders that are frames.
        run: the run whose handles follow.
        put: function that receives the key of an input and its order.
    """

    def __init__(self, leaders: Iterable[Leader], run: Run, put: Callable[[str, PoseOrder], None]) -> None:
        self._leaders, self._run, self._put = list(leaders), run, put
        self._last: dict[str, PoseOrder] = {}

    def look(self, *, anew: bool = False) -> None:
        """Command each handle whose leader has moved since the last call.

        With ``anew``, command each handle whose leader's frame is known, whether or not it has moved.
        """
        if anew:
            self._last.clear()
        for leader in self._leaders:
            frames, size = self._run.frames, self._run.scene.mesh.size
            place: Placement | None = frames.place(leader.frame)
            if place is None:
                continue
            try:
                order = placed_order(leader.handle, place, size=size, frames=frames)
                if order != self._last.get(leader.key):
                    self._put(leader.key, order)
                    self._last[leader.key] = order
            except Refusal as refusal:
                self._run.refusals.refuse(leader.key, refusal)

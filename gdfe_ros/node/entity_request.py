# SPDX-License-Identifier: Apache-2.0
"""A request of ``simulation_interfaces`` to spawn a body: its resource, its name and its place are checked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from gdfe_ros.errors import ArmError, SceneError
from gdfe_ros.node.frames import Frames
from gdfe_ros.node.handle_orders import require_pose
from gdfe_ros.node.placement import Placement
from gdfe_ros.node.refusals import Refusal
from gdfe_ros.node.resources import SPAWNED, path_of
from gdfe_ros.node.standard_answers import Refused, ResultCode
from gdfe_ros.regular_file import read_text
from gdfe_ros.scene.entity import LARGEST, Entity, read_entity
from gdfe_ros.scene.schema import NAME

LONGEST = 60
"""Largest number of letters of a body's name, which becomes a part of the names of topics."""


@dataclass(frozen=True, eq=False, kw_only=True)
class EntityRequest:
    """A request to spawn a body.

    Attributes:
        name: wanted name; empty: the name in the resource.
        renames: whether another name may be given if this one is taken.
        uri: file of the resource; empty: ``text`` is the resource.
        text: the resource itself.
        pose: initial pose, with the frame in its header.
    """

    name: str
    renames: bool
    uri: str
    text: str
    pose: Any

    @classmethod
    def of(cls, request: Any) -> EntityRequest:
        """Return the contents of a request of any version of ``simulation_interfaces``.

        Raises:
            Refused: it asks for a namespace, or its resource is too large.
        """
        resource = getattr(request, "entity_resource", request)  # version 2.1 has a message of its own for it
        if request.entity_namespace:
            text = f"entity_namespace is {request.entity_namespace!r}; allowed: empty, the topics of a body are below "
            raise Refused(ResultCode.NAMESPACE_INVALID, f"{text}this node's name")
        if (size := len(resource.resource_string)) > LARGEST:
            text = f"resource_string has {size} characters; allowed: up to {LARGEST}"
            raise Refused(ResultCode.PARSE_ERROR, text)
        return cls(
            name=request.name,
            renames=request.allow_renaming,
            uri=resource.uri,
            text=resource.resource_string,
            pose=request.initial_pose,
        )

    def entity(self) -> Entity:
        """Return the body that the resource describes.

        Raises:
            Refused: there is no resource, it cannot be read, or it has defects.
        """
        if not (self.uri or self.text):
            raise Refused(ResultCode.NO_RESOURCE, "uri and resource_string are empty; one of them must state the body")
        try:
            return read_entity(_read(self.uri) if self.uri else self.text, where=self.uri or "resource_string")
        except (ArmError, SceneError) as error:
            raise Refused(ResultCode.PARSE_ERROR, str(error)) from error

    def unique_name(self, entity: Entity, taken: set[str]) -> str:
        """Return the name of the body.

        Raises:
            Refused: there is no name, it is no valid name, or it is taken and must not be changed.
        """
        name = self.name or entity.name or ("body" if self.renames else "")
        if not NAME.fullmatch(name) or len(name) > LONGEST:
            text = f"name is {name[: LONGEST + 1]!r}; allowed: up to {LONGEST} letters, digits and _, a letter first"
            raise Refused(ResultCode.NAME_INVALID, text)
        if name not in taken:
            return name
        if not self.renames:
            text = f"the name {name!r} is taken; remedy: another one, or allow_renaming"
            raise Refused(ResultCode.NAME_NOT_UNIQUE, text)
        number = 2
        while f"{name}_{number}" in taken:
            number += 1
        return f"{name}_{number}"


def placement_of(stamped: Any, frames: Frames) -> Placement:
    """Return the placement in the node's frame of a message with a ``header`` and a ``pose``.

    Raises:
        Refused: a number is not finite, the quaternion is not of unit length, or the frame is not known.
    """
    frame = stamped.header.frame_id
    try:
        place, inner = frames.place(frame), require_pose(stamped.pose)
    except Refusal as refusal:
        raise Refused(ResultCode.INVALID_POSE, str(refusal)) from refusal
    if place is None:
        text = f"header.frame_id is {frame!r}; allowed: empty, {frames.frame_id!r}, or a frame connected to it on /tf"
        raise Refused(ResultCode.INVALID_POSE, text)
    return place @ inner


def _read(uri: str) -> str:
    """Return the text of the file at a URI ``file:///path`` or at a path.

    Raises:
        Refused: it is neither, or the file cannot be read.
    """
    path = path_of(uri, SPAWNED, code=ResultCode.UNSUPPORTED_FORMAT)
    try:
        return read_text(path, most=LARGEST)
    except (OSError, ValueError) as error:  # no regular file, no text, or no path
        reason = getattr(error, "strerror", None) or error
        raise Refused(ResultCode.PARSE_ERROR, f"uri {uri[:200]!r} cannot be read as text: {reason}") from error

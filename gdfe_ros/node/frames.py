# SPDX-License-Identifier: Apache-2.0
"""Names and placements of the coordinate frames of a body, and transforms from other frames to them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.arms.dynamics import LinkFrame
from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.constraints.obstacle import ArmLink, Obstacle
from gdfe_ros.node.refusals import Reason, Refusal
from gdfe_ros.node.transforms import Placement, Transforms
from gdfe_ros.scene.scene import Scene
from gdfe_ros.soft_places import fit_rigidly
from gdfe_ros.solver.motion.imu import ImuReading


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
        positions: function that returns the present vertices (n, 3) [m].
        poses: function that returns the present poses of the obstacles by name, relative to rest.
    """

    def __init__(self, frame_id: str, scene: Scene | None = None, transforms: Transforms | None = None) -> None:
        self.frame_id, self._scene, self.transforms = frame_id, scene, transforms
        self._prefix = "/".join([*frame_id.split("/")[:-1], ""])
        self._links = {} if scene is None else self._parents_of_links(scene)
        self.positions: Callable[[], NDArray[np.float64]] = lambda: scene.mesh.vertices
        self.poses: Callable[[], Mapping[str, Pose]] = dict

    def full_name(self, name: str) -> str:
        """Return the name of one of the node's own frames, with the part that tells robots apart.

        Its ``name`` is: ``<handle>_rest``, at the rest centre of a handle or obstacle, its frame of pose and target;
        ``<handle>_centre``, at its present centre, with the node's axes, the frame of its wrench; ``<handle>``, which
        moves and rotates with it; ``<probe>_probe``, which moves and rotates with a material point; ``<probe>_imu``,
        which rotates with the cell around it; ``<sensor>_sensor``, at the present centre of a contact sensor, with the
        node's axes; ``<mesh>_mesh``, which moves and turns with one of several meshes, as best fits its vertices; the
        name of an arm's link; or empty, for the node's own frame.
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
        """Return a dict from link to its parent link, which is empty if its parent is the node's frame.

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

    def places(
        self,
        poses: Mapping[str, Pose],
        probes: Mapping[str, Pose],
        units: Mapping[str, ImuReading],
        positions: NDArray[np.float64],
        links: Mapping[str, LinkFrame],
    ) -> list[Placement]:
        """Return the placements of the moving frames in their ``parents``, in the order of ``moving``.

        Args:
            poses: poses of handles and obstacles, relative to rest.
            probes: poses of the material points.
            units: readings of the inertial measurement units at the material points; empty without dynamics.
            positions: positions of the vertices (n, 3) [m].
            links: frames of the links of arms.
        """
        found = []
        for handle in self._framed:
            place = self._moved(handle, poses[handle.name])
            found += [Placement(place.origin), place]
        points = [(np.array(probes[name].translation), name) for name in self._scene.probes]
        found += [Placement(origin, Rotation.from_rotvec(probes[name].rotation)) for origin, name in points]
        found += [Placement(origin, units[name].orientation) for origin, name in points if name in units]
        found += [Placement(sensor.centre(positions)) for sensor in self._scene.sensors.values()]
        for part in self._scene.mesh.parts.values():
            vertices = slice(part.first_vertex, part.first_vertex + part.mesh.n_vertices)
            origin, axes = fit_rigidly(part.mesh.vertices, positions[vertices])
            found.append(Placement(origin, Rotation.from_matrix(axes)))
        return found + self._joined(links)

    def _joined(self, links: Mapping[str, LinkFrame]) -> list[Placement]:
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
                f"to them on /tf; frames on /tf: {', '.join(self.transforms.known()) or 'none'}"
            )
            raise Refusal(Reason.FRAME, text)
        return found

    def _own(self) -> dict[str, tuple[str, Placement]]:
        """Return a dict from frame name to its parent and its placement there, for frames that the node computes.

        A handle's frame has the rotation that best fits the handle's vertices.
        """
        now, poses = self.positions(), self.poses()
        own = {name: (self.frame_id, place) for name, place in self.rests().items()}
        for handle in self._framed:
            obstacle = isinstance(handle, Obstacle)
            place = self._moved(handle, poses.get(handle.name, Pose())) if obstacle else self._turned(handle, now)
            own[self.full_name(f"{handle.name}_centre")] = self.frame_id, Placement(place.origin)
            own[self.full_name(handle.name)] = self.frame_id, place
        centres = {name: sensor.centre(now) for name, sensor in self._scene.sensors.items()}
        return own | {
            self.full_name(f"{name}_sensor"): (self.frame_id, Placement(centre)) for name, centre in centres.items()
        }

    def _moved(self, handle: Handle, pose: Pose) -> Placement:
        """Return the placement of the frame of a handle or obstacle with a pose relative to rest."""
        origin = handle.centre(self._scene.mesh.vertices) + pose.translation
        return Placement(origin, Rotation.from_rotvec(pose.rotation))

    def _turned(self, handle: Handle, now: NDArray[np.float64]) -> Placement:
        """Return the placement of a handle's frame, fitted to the body's vertices ``now`` (n, 3) [m]."""
        rest, centre = self._scene.mesh.vertices, handle.centre(now)
        arms = now[handle.vertices] - centre, rest[handle.vertices] - handle.centre(rest)
        return Placement(centre, Rotation.align_vectors(*arms)[0])

# SPDX-License-Identifier: Apache-2.0
"""The messages of every step as templates: clouds of vertices and cells, poses, wrenches."""

from __future__ import annotations

import array
import struct

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import PointCloud2

from gdfe_ros.constraints import Pose
from gdfe_ros.node import messages
from gdfe_ros.node.messages import MESH_FIELDS, STRAIN_FIELDS
from gdfe_ros.node.template import Template
from gdfe_ros.solver.elements.fields import ElementFields

_MARK = -1.2345678901234567e300
_NO_TURN = (0.0, 0.0, 0.0, 1.0)


class MeshPacker:
    """Packs vertices; the messages are those of ``messages.mesh_cloud``.

    Args:
        rest: (n, 3) vertices at rest [m].
        frame_id: of their coordinates.
    """

    def __init__(self, rest: NDArray[np.float64], frame_id: str) -> None:
        self._rest = rest
        cloud = messages.mesh_cloud(messages.header(0, frame_id), rest, rest)
        self._template, self._values = _cloud_template(cloud, (len(rest), len(MESH_FIELDS)))

    def pack(self, stamp: int, positions: NDArray[np.float64]) -> bytes:
        """Serialise positions (n, 3) [m] with a stamp [ns]."""
        self._values[:, :3] = positions
        np.subtract(positions, self._rest, out=self._values[:, 3:], casting="same_kind")
        return self._template.stamped(stamp)


class StrainPacker:
    """Packs element fields; the messages are those of ``messages.strain_cloud``.

    Args:
        fields: any of the body.
        frame_id: of the centroids' coordinates.
    """

    def __init__(self, fields: ElementFields, frame_id: str) -> None:
        cloud = messages.strain_cloud(messages.header(0, frame_id), fields)
        self._template, self._values = _cloud_template(cloud, (len(fields.J), len(STRAIN_FIELDS)))

    def pack(self, stamp: int, fields: ElementFields) -> bytes:
        """Serialise fields with a stamp [ns]."""
        self._values[:, :3] = fields.centroids
        for column, name in enumerate(STRAIN_FIELDS[3:], start=3):
            self._values[:, column] = getattr(fields, name)
        return self._template.stamped(stamp)


class PosePacker:
    """Packs poses; the messages are those of ``messages.pose_stamped``.

    Args:
        frame_id: that the poses are given in.
    """

    def __init__(self, frame_id: str) -> None:
        message = messages.pose_stamped(messages.header(0, frame_id), Pose())
        message.pose.position.x = _MARK
        self._template = Template(message)
        self._values = self._template.view(struct.pack("<d", _MARK), (7,), "<f8")

    def pack(self, stamp: int, pose: Pose) -> bytes:
        """Serialise a pose with a stamp [ns]."""
        self._values[:3] = pose.translation
        self._values[3:] = Rotation.from_rotvec(pose.rotation).as_quat() if any(pose.rotation) else _NO_TURN
        return self._template.stamped(stamp)


class WrenchPacker:
    """Packs reactions; the messages are those of ``messages.wrench_stamped``.

    Args:
        frame_id: that the wrenches are given in.
    """

    def __init__(self, frame_id: str) -> None:
        reaction = np.array([_MARK, 0.0, 0.0, 0.0, 0.0, 0.0])
        self._template = Template(messages.wrench_stamped(messages.header(0, frame_id), reaction))
        self._values = self._template.view(struct.pack("<d", _MARK), (6,), "<f8")

    def pack(self, stamp: int, reaction: NDArray[np.float64]) -> bytes:
        """Serialise a reaction (6,), force [N] then moment [N m], with a stamp [ns]."""
        self._values[:] = reaction
        return self._template.stamped(stamp)


def _cloud_template(cloud: PointCloud2, shape: tuple[int, int]) -> tuple[Template, NDArray[np.float32]]:
    """Make a template of a cloud and the view of its points."""
    mark = struct.pack("<d", _MARK)
    cloud.data = array.array("B", mark + bytes(cloud.data[len(mark) :]))
    template = Template(cloud)
    return template, template.view(mark, shape, "<f4")

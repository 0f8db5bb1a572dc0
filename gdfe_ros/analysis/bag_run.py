# SPDX-License-Identifier: Apache-2.0
"""A recorded run: the contents of a node's bag, as arrays."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Collection, Iterable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.analysis.message_values import cloud_values
from gdfe_ros.contacts import total_forces
from gdfe_ros.errors import RecordingError
from gdfe_ros.mesh import HexMesh
from gdfe_ros.recording.decoding import array_decoder
from gdfe_ros.recording.reader import BagReader
from gdfe_ros.recording.step_record import StepRecord
from gdfe_ros.recording.topic import TopicInfo
from gdfe_ros.scene import Scene, scene_from_text

RECORD = "step_record"


class BagRun:
    """The run in a bag that a node recorded.

    Args:
        path: directory of the bag, or one of its MCAP files.

    Raises:
        RecordingError: there is no bag, or it was not recorded by this package's node.

    Attributes:
        reader: reader of the bag.
        roles: dict from role to topic name. The role is the topic's default name in the node, such as
            ``handles/tip/pose``; remapping does not change it. If the bag states no role for a topic, its role is the
            topic's name without the node's name; for a topic of another node, it is the full name.
    """

    def __init__(self, path: str | Path) -> None:
        self.reader = BagReader(path)
        self._decode = array_decoder(self.reader.topics.values())
        self.roles = _roles(self.reader.topics.values())
        if self.reader.run is None or not self.topics(f"/{RECORD}"):
            raise RecordingError(f"bag {path} {_what_it_is(self.reader.topics)}")

    @property
    def message_count(self) -> int:
        """Number of messages in the bag."""
        return len(self.reader)

    @cached_property
    def scene(self) -> Scene:
        """Scene that was simulated."""
        return scene_from_text(self.reader.run.scene, origin=f"of bag {self.reader.path}")

    @property
    def mesh(self) -> HexMesh:
        """Undeformed mesh."""
        return self.scene.mesh

    @cached_property
    def records(self) -> list[StepRecord]:
        """Records of all steps, in order."""
        return [StepRecord.from_json(message.data) for _, message in self.messages(f"/{RECORD}")]

    def topics(self, ending: str) -> list[str]:
        """Return the sorted names of the topics for which ``/`` followed by the role ends with ``ending``."""
        return sorted(name for role, name in self.roles.items() if f"/{role}".endswith(ending))

    def messages(self, ending: str) -> Iterator[tuple[int, Any]]:
        """Yield log time [ns] and decoded message, for each message of the topics that match ``ending``."""
        for message in self.reader.messages(self.topics(ending)):
            yield message.log_time, self._decode(message.type, message.data)

    def last_positions(self) -> NDArray[np.float64]:
        """Return the vertex positions (n, 3) [m] of the last mesh message."""
        columns = cloud_values(_last(self.messages("/mesh"))[1])
        return np.stack([columns[axis] for axis in "xyz"], axis=1).astype(np.float64)

    def last_wrenches(self) -> dict[str, tuple[tuple[float, ...], tuple[float, ...]]]:
        """Return the last force (3,) [N] and moment (3,) [N m] on the body, as a dict from handle or obstacle.

        Wrenches of contact sensors are included, with the keys ``sensor <name>``.
        """
        wrenches = {}
        for role in sorted(role for role in self.roles if role.endswith("/wrench")):
            _, message = _last(self.messages(f"/{role}"))
            force, torque = message.wrench.force, message.wrench.torque
            section, name = role.split("/")[-3:-1]
            name = f"sensor {name}" if section == "sensors" else name
            wrenches[name] = (force.x, force.y, force.z), (torque.x, torque.y, torque.z)
        return wrenches

    def last_places(self, pattern: str) -> dict[str, tuple[float, float, float]]:
        """Return the last position (3,) [m] of each topic of poses whose role matches a pattern, e.g. ``probe/*``.

        Returns:
            Dict from the part of the role in the place of ``*``.
        """
        names = {role: re.fullmatch(pattern.replace("*", "([^/]+)"), role) for role in sorted(self.roles)}
        places = {}
        for role, found in names.items():
            if found:
                place = _last(self.messages(f"/{role}"))[1].pose.position
                places[found[1]] = place.x, place.y, place.z
        return places

    def last_total_forces(self) -> dict[str, NDArray[np.float64]]:
        """Return the last total contact force (3,) [N] on each obstacle and rigid body; empty without contact."""
        if not self.topics("/contacts"):
            return {}
        return total_forces(cloud_values(_last(self.messages("/contacts"))[1]), self.scene.handles)


def _roles(topics: Iterable[TopicInfo]) -> dict[str, str]:
    """Return dict from role to topic name."""
    known = {topic.name: topic.role for topic in topics}
    record = next((name for name in known if name.endswith(f"/{RECORD}")), "")
    prefix = record.removesuffix(RECORD) or "//"
    return {role or name.removeprefix(prefix): name for name, role in known.items()}


def _last(items: Iterator[Any]) -> Any:
    kept = deque(items, maxlen=1)
    if not kept:
        raise RecordingError("the bag holds no message of this topic")
    return kept[0]


def _what_it_is(topics: Collection[str]) -> str:
    """Return what a bag without step records is, and what can read it."""
    if any(name.startswith("/gdfe_twin/") for name in topics):
        text = "was recorded by gdfe twin, whose moduli change between steps, so that it has no step records"
        return f"{text}; remedy: Foxglove, PlotJuggler or `gdfe fit SCENE BAG --match FILE` read its topics"
    shown = [name[:80] for name in sorted(topics)[:8]] + [f"{len(topics) - 8} more"] * (len(topics) > 8)
    remedy = "remedy: a bag of sim_node, gdfe demo or gdfe live; `gdfe fit` reads bags of other recorders"
    return f"was not recorded by sim_node; its topics: {', '.join(shown) or 'none'}; {remedy}"

# SPDX-License-Identifier: Apache-2.0
"""Names and descriptions of every parameter, topic and service of the node.

The node's declarations and the tables of its documentation page are both generated from this package.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

NODE_NAME = "gdfe_sim"
FRAME = "base_link"
"""Frame of the rest shape, unless a parameter names another one (REP-105)."""


class Changeable(Enum):
    """When a parameter may be changed."""

    START = "only at start"
    UNCONFIGURED = "while unconfigured"
    INACTIVE = "while not active"
    ALWAYS = "at any time"


class Delivery(Enum):
    """Quality of service of a topic, named by the purpose of the topic."""

    STATE = "reliable, transient local, last 10"
    CLOUD = "reliable, transient local, the last"
    COMMAND = "reliable, volatile, last 1000"
    LATCHED = "reliable, transient local, last 1, while not active, too"
    EVENT = "reliable, volatile, last 100, while not active, too"
    CLOCK = "best effort, volatile, last 1"
    TRANSFORMS = "reliable, volatile, last 100"
    FOLLOWED = "best effort, volatile, last 10"


@dataclass(frozen=True, kw_only=True)
class ParameterSpec:
    """One parameter; its ROS descriptor and its row in the documentation are made from this description.

    Attributes:
        name: name of the parameter.
        default: default value; its type is the parameter's type.
        meaning: description in one sentence.
        unit: SI unit; empty for texts and switches.
        least: smallest allowed value; None: no bound.
        most: largest allowed value; None: no bound.
        choices: allowed texts; empty: any text.
        change: when the parameter may be changed.
    """

    name: str
    default: bool | int | float | str | list[str]
    meaning: str
    unit: str = ""
    least: float | None = None
    most: float | None = None
    choices: tuple[str, ...] = ()
    change: Changeable = Changeable.ALWAYS

    @property
    def kind(self) -> str:
        """Name of the parameter's type, for users."""
        if isinstance(self.default, list):
            return "list of strings"
        return {bool: "bool", int: "integer", float: "double", str: "string"}[type(self.default)]

    @property
    def allowed(self) -> str:
        """Text with the allowed values, for users; empty if every value of the type is allowed."""
        if self.choices:
            return ", ".join(self.choices)
        return "" if self.least is None else f"{self.least:g} to {self.most:g}"


@dataclass(frozen=True, kw_only=True)
class TopicSpec:
    """One topic. With ``{handle}`` in its name, it describes a topic for each handle; likewise for other items.

    Attributes:
        name: name as in rclpy: ``~/`` stands for the node's full name.
        type: ROS type, e.g. ``sensor_msgs/msg/PointCloud2``.
        meaning: contents of its messages, with units.
        delivery: quality of service.
        recorded: whether bags contain the topic.
    """

    name: str
    type: str
    meaning: str
    delivery: Delivery = Delivery.STATE
    recorded: bool = True

    def key(self, **names: str) -> str:
        """Return the name relative to the node's name, as in bags and ``command_set``; ``names`` fill the braces."""
        return self.name.removeprefix("~/").format(**names)


@dataclass(frozen=True, kw_only=True)
class ServiceSpec:
    """One service: name, ROS type, effect."""

    name: str
    type: str
    meaning: str

    @property
    def key(self) -> str:
        """Name relative to the node's name."""
        return self.name.removeprefix("~/")

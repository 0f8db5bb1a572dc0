# SPDX-License-Identifier: Apache-2.0
"""Decoding of messages, either with rosbags, which needs no ROS, or with rclpy."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from importlib import import_module
from typing import Any

from gdfe_ros.errors import RecordingError
from gdfe_ros.recording.expansion import expand_message
from gdfe_ros.recording.topic import TopicInfo

_RULE = "=" * 80 + "\n"
"""Line before each IDL file in a definition."""
Decoder = Callable[[str, bytes], Any]


def array_decoder(topics: Iterable[TopicInfo]) -> Decoder:
    """Return a decoder for the types of these topics, made from the definitions in the bag; needs no ROS.

    Args:
        topics: topics of a bag, e.g. ``reader.topics.values()``.

    Returns:
        A function that returns a message from its type name and its CDR bytes. The message has the fields of the ROS
        message; a sequence of numbers is a numpy array, e.g. ``data`` of a PointCloud2: (n,) uint8. The function raises
        ``RecordingError`` for invalid bytes.

    Raises:
        RecordingError: a definition is damaged.

    Example:
        >>> decode = array_decoder(reader.topics.values())
        >>> clouds = [decode(m.type, m.data) for m in reader.messages(["/gdfe_sim/mesh"])]
    """
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.EMPTY)
    for topic in topics:
        try:
            types = _types_of(topic)
            store.register({name: fields for name, fields in types.items() if name not in store.fielddefs})
        except Exception as error:  # the exceptions of rosbags for invalid definitions are not documented
            raise RecordingError(
                f"topic {topic.name}: the bag's definition of {topic.type} cannot be read: {_line(error)}"
            ) from error

    def decode(type_name: str, data: bytes) -> Any:
        try:
            return store.deserialize_cdr(expand_message(data), type_name)
        except Exception as error:  # the exceptions for invalid bytes are not documented either
            raise RecordingError(
                f"{len(data)} bytes do not match the bag's definition of {type_name}: {_line(error)}"
            ) from error

    return decode


def _types_of(topic: TopicInfo) -> dict[str, Any]:
    """Return the types in the definition of a topic, which is one of ``.msg`` files or of IDL files."""
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    if not topic.definition.startswith(f"{_RULE}IDL: "):
        return get_types_from_msg(topic.definition, topic.type)
    found: dict[str, Any] = {}
    for part in topic.definition.split(_RULE)[1:]:
        found |= get_types_from_idl(part.partition("\n")[2])
    return found


def _line(error: Exception) -> str:
    """Return the text of an error of rosbags as one line of at most 200 characters."""
    return " ".join(str(error).split())[:200] if type(error).__module__.startswith("rosbags") else "it is damaged"


def rclpy_decoder() -> Decoder:
    """Return a function that returns a message of an installed ROS package from its type name and its CDR bytes."""
    from rclpy.serialization import deserialize_message

    @cache
    def message_class(type_name: str) -> type:
        package, _, name = type_name.split("/")
        return getattr(import_module(f"{package}.msg"), name)

    return lambda type_name, data: deserialize_message(data, message_class(type_name))

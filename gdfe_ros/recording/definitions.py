# SPDX-License-Identifier: Apache-2.0
"""Message definitions and type hashes, read from the ROS installation, in the form that rosbag2 embeds in bags.

Every ROS message package, from a wheel, from apt or from a workspace, installs two files for each type.
``share/<package>/msg/<Name>.msg`` is the text; ``<Name>.json`` is the type description with its REP-2011 hash. Both are
read without importing ROS.
"""

from __future__ import annotations

import json
import re
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from gdfe_ros.errors import RecordingError

_PRIMITIVES = frozenset(
    {"bool", "byte", "char", "string", "wstring", "float32", "float64"}
    | {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
)
_TYPE_NAME = re.compile(r"^[A-Za-z]\w*/msg/[A-Za-z]\w*$")
_SEPARATOR = "=" * 80


@cache
def message_definition(type_name: str) -> str:
    """Return the concatenated ``.msg`` texts of a type and of every type it contains (encoding ``ros2msg``).

    Args:
        type_name: name of the type, e.g. ``sensor_msgs/msg/PointCloud2``.

    Returns:
        The text of the type, then the texts of the types that it contains, sorted by name. A line of 80 ``=`` and a
        line ``MSG: pkg/Name`` precede the text of each contained type.

    Raises:
        RecordingError: the name is not that of a message type, or the type's package is not installed.
    """
    texts: dict[str, str] = {}
    pending = [type_name]
    while pending:
        name = pending.pop()
        if name not in texts:
            texts[name] = _share_file(name, ".msg").read_text(encoding="utf-8")
            pending += _parts(name, texts[name])
    root = texts.pop(type_name)
    return root + "".join(f"\n{_SEPARATOR}\nMSG: {name.replace('/msg/', '/')}\n{texts[name]}" for name in sorted(texts))


@cache
def type_hash(type_name: str) -> str:
    """Return the type hash ``RIHS01_<sha256>`` (REP-2011) of a message type.

    Raises:
        RecordingError: the name is not that of a message type, its package is not installed, or the type has no hash.
    """
    path = _share_file(type_name, ".json")
    for entry in json.loads(path.read_text(encoding="utf-8"))["type_hashes"]:
        if entry["type_name"] == type_name:
            return entry["hash_string"]
    raise RecordingError(f"{path} holds no type hash of {type_name}: reinstall the message package")


def _share_file(type_name: str, suffix: str) -> Path:
    if not _TYPE_NAME.match(type_name):
        raise RecordingError(f"message type {type_name!r} is not of the form package/msg/Name")
    package, _, name = type_name.split("/")
    spec = find_spec(package)
    # A namespace package has no origin but search locations; both lie below the installation's prefix.
    places = [*(spec.submodule_search_locations or [])] if spec else []
    for place in places:
        for prefix in Path(place).resolve().parents:
            path = prefix / "share" / package / "msg" / f"{name}{suffix}"
            if path.is_file():
                return path
    reason = f"has no share/{package}/msg/{name}{suffix}" if places else "is not importable"
    raise RecordingError(
        f"message type {type_name}: the ROS package {package} {reason}. Source a ROS 2 Jazzy setup.bash, or "
        "install the ROS wheels: pip install 'gdfe_ros[ros]'."
    )


def _parts(type_name: str, text: str) -> list[str]:
    """Return the names of the message types of the fields in a definition; ``text`` is the ``.msg`` text."""
    package = type_name.split("/")[0]
    found = []
    for line in text.splitlines():
        words = line.split("#", 1)[0].split()
        base = re.sub(r"(\[.*\]|<=.*)", "", words[0]) if words else ""
        if base and base not in _PRIMITIVES:
            owner, _, name = base.rpartition("/")
            found.append(f"{owner.split('/')[0] or package}/msg/{name}")
    return found

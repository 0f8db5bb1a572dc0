# SPDX-License-Identifier: Apache-2.0
"""Origin of a run, stored in its bag, so that the bag alone is enough to repeat the run."""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gdfe_ros
from gdfe_ros.untrusted.bounded_text import load_json_object

if TYPE_CHECKING:
    from gdfe_ros.scene.scene import Scene

SCENE_FILE = "scene.yaml"
STATE_FILE = "state.bin"
"""Name of the attachment with the first state of a bag (see checkpoint.py). A bag that starts from the scene's initial
state has no such attachment.
"""
_LIBRARIES = ("numpy", "scipy", "numba", "llvmlite")


@dataclass(frozen=True, kw_only=True)
class RunInfo:
    """The origin of a run, embedded in every file of its bag.

    In MCAP terms: the metadata record ``gdfe_ros``, whose values are texts, one attachment with the scene, and one
    attachment for each further file.

    Args:
        scene: text of the scene file (YAML); empty if the run had none.
        settings: solver settings and everything else that affects the result; must be expressible in JSON.
        files: dict from name to content of further files that a replay needs, e.g. the first state.
        package_version: version of gdfe_ros.
        machine: platform, processor and library versions, from ``describe_machine``.
    """

    scene: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, bytes] = field(default_factory=dict)
    package_version: str = gdfe_ros.__version__
    machine: Mapping[str, str] = field(default_factory=lambda: describe_machine())

    @classmethod
    def of(cls, scene: Scene, *, node: Mapping[str, Any] | None = None, state: bytes | None = None) -> RunInfo:
        """Return the origin of a run of a scene.

        Args:
            scene: simulated scene.
            node: parameters of the node or the session; None: there are none.
            state: serialised state from which the first step starts; None: the initial state of the scene.
        """
        settings = {**asdict(scene.solver), "policy": scene.solver.policy.value}
        settings |= {} if node is None else {"node": dict(node)}
        return cls(scene=scene.source, settings=settings, files={} if state is None else {STATE_FILE: state})

    @property
    def scene_sha256(self) -> str:
        """SHA-256 hash of the scene's UTF-8 text, in hexadecimal digits."""
        return hashlib.sha256(self.scene.encode()).hexdigest()

    def to_metadata(self) -> dict[str, str]:
        """Return the metadata record: checksums of scene and files, settings, version and machine, as texts or JSON."""
        return {
            "package_version": self.package_version,
            "scene_sha256": self.scene_sha256,
            "files_sha256": json.dumps({name: hashlib.sha256(data).hexdigest() for name, data in self.files.items()}),
            "settings": json.dumps(self.settings, sort_keys=True),
            "machine": json.dumps(self.machine, sort_keys=True),
        }

    def attachments(self) -> dict[str, bytes]:
        """Return a dict from name to content of the attachments: the scene as ``scene.yaml``, and the further files."""
        return {SCENE_FILE: self.scene.encode(), **self.files}

    @classmethod
    def from_bag(cls, metadata: Mapping[str, str], attachments: Mapping[str, bytes]) -> RunInfo:
        """Return the origin that ``to_metadata`` and ``attachments`` have stored.

        Raises:
            KeyError: the metadata record was not written by this package.
            ValueError: the scene or a file differs from its checksum, or the record has data of another kind.
        """
        files = dict(attachments)
        sums = {SCENE_FILE: metadata["scene_sha256"], **load_json_object(metadata["files_sha256"])}
        for name, checksum in sums.items():
            if hashlib.sha256(files.get(name, b"")).hexdigest() != checksum:
                raise ValueError(f"the attachment {name} does not match its checksum")
        settings, machine = load_json_object(metadata["settings"]), load_json_object(metadata["machine"])
        if not isinstance(settings.get("node", {}), dict) or not all(
            isinstance(each, str) for each in machine.values()
        ):
            raise ValueError("the settings of the node are no mapping, or a fact about the machine is no text")
        return cls(
            scene=files.pop(SCENE_FILE, b"").decode(),
            settings=settings,
            files=files,
            package_version=metadata["package_version"],
            machine=machine,
        )

    @classmethod
    def from_attachments(cls, attachments: Mapping[str, bytes]) -> RunInfo:
        """Return the origin from the attachments alone; settings, version and machine are then unknown."""
        files = dict(attachments)
        scene = files.pop(SCENE_FILE, b"").decode()
        return cls(scene=scene, files=files, package_version="unknown", machine={})


def describe_machine() -> dict[str, str]:
    """Return the platform, processor and library versions, because they affect the last bits of a result."""
    facts = {
        "platform": platform.platform(),
        "processor": _processor(),
        "cores": str(os.cpu_count()),
        "python": platform.python_version(),
    }
    for name in _LIBRARIES:
        try:
            facts[name] = version(name)
        except PackageNotFoundError:
            facts[name] = "absent"
    return facts


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()

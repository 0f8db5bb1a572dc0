# SPDX-License-Identifier: Apache-2.0
"""Directory of a sweep: one small file for each completed case, so that an interrupted sweep can be resumed."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

from gdfe_ros.analysis.sweep.case_run import Result
from gdfe_ros.analysis.sweep.cases import Case
from gdfe_ros.bounded_text import load_json
from gdfe_ros.errors import GdfeError

_FACTS = "sweep.json"


class Archive:
    """Results of a sweep on disk.

    Args:
        directory: directory of the sweep; created if it does not exist.
        scene: YAML text of the scene that the overrides of all cases change.

    Raises:
        GdfeError: the directory contains results of another scene, or files that are not of a sweep.
        OSError: the directory cannot be created.
    """

    def __init__(self, directory: Path, scene: str) -> None:
        self._directory = directory
        self._cases = directory / "cases"
        facts = {"scene_sha256": hashlib.sha256(scene.encode()).hexdigest()}
        known = directory / _FACTS
        if known.is_file():
            if load_json(known.read_text(encoding="utf-8")) != facts:
                raise GdfeError(f"{directory} holds the results of another scene: name another directory or remove it")
        elif directory.exists() and any(directory.iterdir()):
            raise GdfeError(f"{directory} is not empty and holds no sweep: name another directory")
        self._cases.mkdir(parents=True, exist_ok=True)
        _write(known, facts)

    def find(self, case: Case) -> Result | None:
        """Return the result of a case, or None if it is not completed."""
        path = self._cases / f"{case.name}.json"
        return load_json(path.read_text(encoding="utf-8")) if path.is_file() else None

    def keep(self, case: Case, result: Result) -> None:
        """Write a result; if the process is killed, either all of it or nothing is written."""
        _write(self._cases / f"{case.name}.json", result)


def _write(path: Path, data: Any) -> None:
    temporary = path.with_suffix(".tmp")
    temporary.write_text(json.dumps(data), encoding="utf-8")
    os.replace(temporary, path)

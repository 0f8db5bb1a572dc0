# SPDX-License-Identifier: Apache-2.0
"""Message packages built for tests: who can import them, and when."""

from __future__ import annotations

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

BUILDER = Path(__file__).parents[1] / "data" / "interfaces_builder.py"


class _Builder:
    """Makes a package without sources; a second build raises."""

    def __init__(self, definitions: Path, target: Path) -> None:
        self._target = target

    def build(self) -> None:
        self._target.mkdir(parents=True)  # raises where it is there already


def test_who_imports_a_package_sees_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two packages built in one folder are imported separately, and each is built once."""
    specification = spec_from_file_location("interfaces_builder", BUILDER)
    interfaces = module_from_spec(specification)
    specification.loader.exec_module(interfaces)
    monkeypatch.setattr(interfaces, "_Builder", _Builder)
    places = {name: interfaces.build_interfaces(Path(name), tmp_path) for name in ("one_msgs", "other_msgs")}
    for name, place in places.items():
        assert [path.name for path in place.iterdir()] == [name]
        assert interfaces.build_interfaces(Path(name), tmp_path) == place

# SPDX-License-Identifier: Apache-2.0
"""The installed parameter file agrees with the node."""

from __future__ import annotations

from pathlib import Path

import yaml

from gdfe_ros.node.interface import PARAMETERS


def test_every_entry_is_a_parameter_of_the_node(root: Path) -> None:
    """config/sim.yaml has the names, types and default values of the node's own table."""
    content = yaml.safe_load((root / "config" / "sim.yaml").read_text())
    defaults = {spec.name: spec.default for spec in PARAMETERS}
    shown = content["/**"]["ros__parameters"]
    assert shown == {name: defaults[name] for name in shown}

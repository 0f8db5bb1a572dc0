# SPDX-License-Identifier: Apache-2.0
"""The parameter file that the package installs fits the node."""

from __future__ import annotations

from pathlib import Path

import yaml

from gdfe_ros.node.interface.parameters import PARAMETERS


def test_every_entry_is_a_parameter_of_the_node(root: Path) -> None:
    """Compare names, types and values of config/sim.yaml with the node's own table: it shows the defaults."""
    content = yaml.safe_load((root / "config" / "sim.yaml").read_text())
    defaults = {spec.name: spec.default for spec in PARAMETERS}
    shown = content["/**"]["ros__parameters"]
    assert shown == {name: defaults[name] for name in shown}

# SPDX-License-Identifier: Apache-2.0
"""The interface table agrees with a running node and with README."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rcl_interfaces.srv import DescribeParameters, ListParameters

from docs.scripts.node_reference import markdown
from gdfe_ros.node.interface import NODE_NAME, PARAMETERS, SERVICES
from gdfe_ros.node.interface.topics import COMMANDS, OUTPUTS
from gdfe_ros.node.middleware.ros_types import is_installed

_OTHERS = ("/rosout", "/parameter_events", f"/{NODE_NAME}/transition_event")


def _full(name: str) -> str:
    return name.replace("~", f"/{NODE_NAME}").replace("{handle}", "tip").replace("{probe}", "end")


def _own(entries: list[tuple[str, list[str]]]) -> dict[str, list[str]]:
    return {name: kind for name, kind in entries if name not in _OTHERS and "base" not in name}


def test_a_node_offers_what_the_table_says(client: Any, launch: Callable, coarse: dict) -> None:
    """A running node has the topics with types, services and parameters of the table."""
    launch(**coarse, publish_clock=True)
    node = client.node
    client.wait(lambda: NODE_NAME in node.get_node_names())
    # Topics of actuators, grips, arms, probes, motion and contact belong to scenes that have some.
    owners = ("{obstacle}", "{body}", "{sensor}", "/contact", "{link}", "{arm}", "joint_command")
    absent = tuple(spec.name for spec in (*COMMANDS, *OUTPUTS) if any(owner in spec.name for owner in owners))
    absent += ("~/probe/{probe}", "~/probe/{probe}/imu", "~/velocity", "~/joint_states", "~/jacobian")
    absent += ("~/actuation", "~/commands", "~/trajectory", "~/attach", "~/release")
    outputs = {_full(spec.name): [spec.type] for spec in OUTPUTS if spec.name not in absent and is_installed(spec.type)}
    inputs = {_full(spec.name): [spec.type] for spec in COMMANDS if spec.name not in absent}
    services = {_full(spec.name): [spec.type] for spec in SERVICES}.items()
    # The graph fills by and by; what it shows for longer than it should not is found by the wait's end.
    client.wait(lambda: _own(node.get_publisher_names_and_types_by_node(NODE_NAME, "/")) == outputs)
    client.wait(lambda: _own(node.get_subscriber_names_and_types_by_node(NODE_NAME, "/")) == inputs)
    client.wait(lambda: services <= dict(node.get_service_names_and_types_by_node(NODE_NAME, "/")).items())
    listed = client.call(ListParameters, "list_parameters", ListParameters.Request()).result.names
    own = {name for name in listed if not name.startswith(("materials.", "qos_", "start_type_"))} - {"use_sim_time"}
    assert own == {spec.name for spec in PARAMETERS}
    assert {name for name in listed if name.startswith("materials.")} == {
        f"materials.e{stiffness}.young" for stiffness in (100, 80, 60, 40, 20)
    }


def test_descriptors_say_unit_range_and_meaning(client: Any, start: Callable, coarse: dict) -> None:
    """The parameter descriptors of a running node have the table's text, units and ranges."""
    start(**coarse)
    names = [spec.name for spec in PARAMETERS]
    described = client.call(DescribeParameters, "describe_parameters", DescribeParameters.Request(names=names))
    for spec, descriptor in zip(PARAMETERS, described.descriptors, strict=True):
        assert descriptor.description.startswith(spec.meaning)
        assert f"[{spec.unit}]" in descriptor.description or not spec.unit
        assert spec.change.value in descriptor.additional_constraints
        if isinstance(spec.default, float):
            bounds = descriptor.floating_point_range[0]
            assert (bounds.from_value, bounds.to_value) == (spec.least, spec.most)


def test_the_reference_names_everything() -> None:
    """The generated Markdown has each parameter, topic and service with its description."""
    text = markdown()
    for spec in (*COMMANDS, *OUTPUTS, *SERVICES, *PARAMETERS):
        name = spec.name.replace("{", "<").replace("}", ">")
        row = next(line for line in text.splitlines() if line.startswith(f"| `{name}` |"))
        assert spec.meaning in row

# SPDX-License-Identifier: Apache-2.0
"""The node's interface as Markdown for the documentation, generated so that it cannot become outdated.

``python -m docs.scripts.node_reference`` prints it. No ROS is needed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from gdfe_ros.node.interface import ACTIONS, MODULUS, PARAMETERS, SERVICES, STANDARD_SERVICES, ParameterSpec, TopicSpec
from gdfe_ros.node.interface.topics import COMMANDS, OUTPUTS


def markdown() -> str:
    """Return the tables of parameters, topics and services."""
    parts = [
        "### Topics in",
        _table(("topic", "type", "meaning", "QoS"), map(_topic, COMMANDS)),
        "### Topics out",
        _table(("topic", "type", "meaning", "QoS"), map(_topic, OUTPUTS)),
        "### Services",
        _table(
            ("service", "type", "meaning"),
            ((f"`{spec.name}`", f"`{spec.type}`", spec.meaning) for spec in SERVICES),
        ),
        "Where the package `simulation_interfaces` is installed, also:",
        _table(
            ("service", "type", "meaning"),
            ((f"`{spec.name}`", f"`{spec.type}`", spec.meaning) for spec in STANDARD_SERVICES),
        ),
        "Where the package `control_msgs` is installed, also:",
        _table(("action", "type", "meaning"), [(f"`{each.name}`", f"`{each.type}`", each.meaning) for each in ACTIONS]),
        "### Parameters",
        _table(
            ("parameter", "type", "default", "unit", "allowed", "meaning", "changed"),
            map(_parameter, (*PARAMETERS, MODULUS)),
        ),
    ]
    return "\n\n".join(parts) + "\n"


def _topic(spec: TopicSpec) -> Sequence[str]:
    name, of = spec.name.replace("{", "<").replace("}", ">"), spec.delivery
    quality = f"{'reliable' if of.reliable else 'best effort'}, {'transient local' if of.local else 'volatile'}"
    quality += f", last {of.depth}{', while not active, too' * of.always}"
    return f"`{name}`", f"`{spec.type}`", spec.meaning, quality


def _parameter(spec: ParameterSpec) -> Sequence[str]:
    default = str(spec.default).lower() if spec.kind == "bool" else str(spec.default)
    default = "" if spec.default in ("", [""]) else f"`{default}`"
    return (
        f"`{spec.name.replace('{', '<').replace('}', '>')}`",
        spec.kind,
        default,
        spec.unit,
        spec.allowed,
        spec.meaning,
        spec.change.value,
    )


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


if __name__ == "__main__":
    print(markdown(), end="")

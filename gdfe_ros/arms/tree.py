# SPDX-License-Identifier: Apache-2.0
"""Checks that links and joints form a tree, and that joints mimic only commanded joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from graphlib import CycleError, TopologicalSorter

from gdfe_ros.arms.description import Joint
from gdfe_ros.untrusted.spelling import did_you_mean


def root_of(names: set[str], joints: Sequence[Joint]) -> tuple[str, list[str]]:
    """Return the link without a parent, and messages about the defects that prevent a tree.

    Args:
        names: names of the links.
        joints: joints between the links.
    """
    found = []
    for joint in joints:
        for end in (joint.parent, joint.child):
            if end and end not in names:
                hint = did_you_mean(end, sorted(names))
                found.append(
                    f"joint {joint.name!r} refers to the link {end!r}, which is not there; {hint}".rstrip("; ")
                )
    above: dict[str, list[str]] = {}
    for joint in joints:
        above.setdefault(joint.child, []).append(joint.name)
    several = {child: over for child, over in above.items() if len(over) > 1}
    for child, over in several.items():
        loop = f"link {child!r} is the child of the joints {', '.join(over)}: a closed loop"
        found.append(f"{loop}; remedy: keep one of them, and let the other joints of the loop mimic it")
    roots = sorted(names - set(above))
    if not names:
        found.append("there is no <link>")
    elif not roots:
        found.append("every link is the child of a joint: a closed loop; remedy: remove the joint that closes it")
    elif len(roots) > 1:
        text = f"the links {', '.join(roots)} have no parent; allowed: one, the base"
        found.append(f"{text}; remedy: joints between them")
    elif not several:
        found += _cycles(joints)
    return roots[0] if roots else "", found


def _cycles(joints: Sequence[Joint]) -> list[str]:
    """Return a list with a message about links that form a loop apart from the root; empty if there are none."""
    try:
        TopologicalSorter({joint.child: [joint.parent] for joint in joints}).prepare()
    except CycleError as error:
        loop = ", ".join(sorted(set(error.args[1])))
        return [f"the links {loop} form a closed loop; remedy: remove the joint that closes it"]
    return []


def mimic_defects(joints: Mapping[str, Joint]) -> list[str]:
    """Return messages about joints that mimic a missing or fixed joint, or a joint that itself mimics another one."""
    found, leaders = [], [joint.name for joint in joints.values() if joint.moves and joint.mimic is None]
    for joint in joints.values():
        if joint.mimic is None:
            continue
        name, source = joint.mimic.joint, joints.get(joint.mimic.joint)
        if source is None or not source.moves:
            hint = did_you_mean(name, leaders)
            text = f"mimics {name!r}, which is no joint that moves; {hint}joints: {', '.join(leaders) or 'none'}"
            found.append(f"joint {joint.name!r} {text}")
        elif source.mimic is not None:
            leader = _end_of_chain(joint, joints)
            remedy = f"let it mimic {leader!r}" if leader in leaders else "remove its <mimic>"
            text = "itself" if source is joint else f"{name!r}, which mimics {source.mimic.joint!r}"
            found.append(f"joint {joint.name!r} mimics {text}; remedy: {remedy}")
    return found


def _end_of_chain(joint: Joint, joints: Mapping[str, Joint]) -> str:
    """Return the name of the last joint of a chain in which each joint mimics the next one; any joint of a loop."""
    name = joint.name
    for _ in joints:
        own = joints.get(name)
        name = name if own is None or own.mimic is None else own.mimic.joint
    return name

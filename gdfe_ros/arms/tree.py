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
    found = []
    for joint in joints.values():
        if joint.mimic is None:
            continue
        source = joints.get(joint.mimic.joint)
        if source is None or not source.moves:
            hint = did_you_mean(joint.mimic.joint, list(joints))
            text = f"joint {joint.name!r} mimics {joint.mimic.joint!r}, which is no joint that moves; {hint}"
            found.append(text.rstrip("; "))
        elif source.mimic is not None:
            text = f"joint {joint.name!r} mimics {source.name!r}, which mimics {source.mimic.joint!r} itself"
            found.append(f"{text}; remedy: let it mimic {source.mimic.joint!r}")
    return found

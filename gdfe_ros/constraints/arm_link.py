# SPDX-License-Identifier: Apache-2.0
"""Links of an arm as obstacles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from gdfe_ros.constraints.obstacle import Obstacle


@dataclass(frozen=True, eq=False, kw_only=True)
class ArmLink(Obstacle):
    """A convex piece of an arm's link: an obstacle that only the arm's joints move.

    Attributes:
        fixed: true, because the piece accepts no commands of its own.
        arm: name of the arm.
        link: name of the link.
    """

    noun: ClassVar[str] = "link"
    section: ClassVar[str] = "links"
    fixed: bool = True
    arm: str
    link: str

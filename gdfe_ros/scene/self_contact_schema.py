# SPDX-License-Identifier: Apache-2.0
"""The key `self_contact` of a scene file, which lets surfaces of the mesh touch each other."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from gdfe_ros.scene.entry import Entry
from gdfe_ros.scene.obstacle_schema import RESTITUTION
from gdfe_ros.scene.quantity import Quantity
from gdfe_ros.scene.where_schema import WhereModel

_FRICTION = Quantity("Coulomb's coefficient of friction", least=0.0, most=100.0)


class SelfContactModel(Entry):
    """Contact of the parts of the mesh with each other, and of each part with itself."""

    friction: Annotated[float, _FRICTION] = 0.0
    restitution: Annotated[float, RESTITUTION] = 0.0
    where: WhereModel | None = Field(
        None, description="the faces that take part: all faces with all four vertices in this place (default: all)"
    )

# SPDX-License-Identifier: Apache-2.0
"""The keys of a scene file for layers of fibres."""

from __future__ import annotations

from enum import Enum
from typing import Annotated

from pydantic import Field, field_validator

from gdfe_ros.scene.entry import Entry
from gdfe_ros.scene.quantity import ANY, Quantity
from gdfe_ros.scene.where_schema import WhereModel

_ALONG = Quantity("direction [x, y, z] in the axes of the scene", least=-1e6, most=1e6, count=3)
_ANGLES = Quantity("angle of each family of fibres", "degrees", least=-360.0, most=360.0, count=ANY)
_STIFFNESS = Quantity("Young's modulus times thickness", "N/m", above=0.0, most=1e12)


class Wall(str, Enum):
    """The walls of a body that can carry fibres."""

    OUTER = "outer"
    INNER = "inner"


class FibreLayerModel(Entry):
    """A thin layer of fibres on faces of the body: hoops, a braid, or a sheet that limits strains."""

    wall: Wall = Field(Wall.OUTER, description="outer: the outside of the body; inner: the walls of its cavities")
    where: WhereModel | None = Field(None, description="faces with all corners in this place; default: the whole wall")
    along: Annotated[tuple[float, float, float], _ALONG] = Field(
        description="direction that is projected onto each face; the angles are measured from it"
    )
    angles_deg: Annotated[tuple[float, ...], _ANGLES] = Field(
        (0.0,),
        min_length=1,
        description="angles of the fibres from `along`, counter-clockwise seen from outside the material; "
        "[90]: hoops around `along`; [0, 60, 120]: a sheet with the same stiffness in all directions",
    )
    stiffness: Annotated[float, _STIFFNESS]
    compression: bool = Field(False, description="true: the fibres also resist compression; false: they are slack then")

    @field_validator("along")
    @classmethod
    def _direction(cls, along: tuple[float, float, float]) -> tuple[float, float, float]:
        if not any(along):
            raise ValueError("must not be zero; needed: a direction, e.g. [0, 0, 1]")
        return along

# SPDX-License-Identifier: Apache-2.0
"""The keys of a scene file for arms."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from gdfe_ros.quantity import Quantity, RotationQuantity, Vector
from gdfe_ros.scene.base_entry import Entry, one_of
from gdfe_ros.scene.schemas.paths import FilePath

_AT = Quantity("position of the origin of the root link [x, y, z]", "m", least=-1e3, most=1e3, count=3)
_ROTATION = RotationQuantity("rotation vector of the root link [x, y, z], or several in turn about fixed axes")
_FAST = Quantity("largest velocity, in rad/s or m/s", above=0.0, most=1e6)
_HARD = Quantity("largest acceleration, in rad/s^2 or m/s^2", above=0.0, most=1e9)


class JointLimitsModel(Entry):
    """Limits of a joint, which replace the limits in the URDF."""

    lower: Annotated[float, Quantity("smallest position, in rad or m", least=-1e6, most=1e6)] | None = None
    upper: Annotated[float, Quantity("largest position, in rad or m", least=-1e6, most=1e6)] | None = None
    velocity: Annotated[float, _FAST] | None = None
    acceleration: Annotated[float, _HARD] | None = None
    effort: Annotated[float, Quantity("largest effort, in N m or N", above=0.0, most=1e9)] | None = None


class SpringModel(Entry):
    """A spring and a damper between a joint's motor, which is at the commanded position, and the joint's link."""

    stiffness: Annotated[float, Quantity("stiffness, in N m/rad or N/m", above=0.0, most=1e12)]
    damping: Annotated[float, Quantity("viscous damping, in N m s/rad or N s/m", least=0.0, most=1e12)] = 0.0


class ArmModel(Entry):
    """An arm of rigid links that carries a handle of the soft body: its joints move the handle."""

    urdf: FilePath | None = Field(
        None,
        description="path of its URDF; for xacro, the file that `xacro` writes; `pip://<package>/<path>` is a file of "
        "an installed package of Python",
    )
    embedded: str | None = Field(None, description="a packed URDF with its meshes, as recorded scenes contain it")
    flange: str = Field(description="name of the link that carries the handle, e.g. tool0")
    handle: str = Field(description="name of the handle; its pose relative to the flange stays the initial one")
    at: Annotated[Vector, _AT] = (0.0, 0.0, 0.0)
    rotation_deg: Annotated[Vector, _ROTATION] = (0.0, 0.0, 0.0)
    start: dict[str, float] = Field(
        {},
        description="initial positions of joints [rad] or [m], by name; the others are at 0, or at the limit that is "
        "nearest to 0",
    )
    prefix: str = Field("", description="put before the names of its links and joints, so that two arms differ")
    packages: dict[str, FilePath] = Field({}, description="folders of the packages in package://, by name")
    limits: dict[str, JointLimitsModel] = Field({}, description="limits that replace those of the URDF, by joint")
    velocity: Annotated[float, _FAST] | None = Field(
        None, description="largest velocity of joints for which the URDF states none, or 0"
    )  # fmt: skip
    acceleration: Annotated[float, _HARD] | None = Field(
        None, description="largest acceleration of joints without a limit of their own; default: the acceleration that "
        "reaches the joint's largest velocity in 0.1 s"
    )  # fmt: skip
    compliance: dict[str, SpringModel] = Field(
        {},
        description="joints that yield under load, by name, e.g. {elbow: {stiffness: 4000, damping: 20}}; all other "
        "joints are rigid",
    )
    links: tuple[str, ...] | None = Field(
        None,
        description="links whose collision shapes the soft body and rigid bodies touch; default: all that have one, "
        "except those that are fixed to the flange; []: none",
    )
    friction: Annotated[float, Quantity("Coulomb's coefficient of friction of its links", least=0.0, most=100.0)] = 0.0

    _one_source = one_of("urdf", "embedded", "give urdf, the path of its URDF")

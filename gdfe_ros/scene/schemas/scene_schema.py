# SPDX-License-Identifier: Apache-2.0
"""The keys of a scene file: meaning, unit, range and default of each."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, StringConstraints, WrapValidator, model_validator

from gdfe_ros.constraints import Axis
from gdfe_ros.mesh.selection import Where
from gdfe_ros.scene.base_entry import Entry, one_of
from gdfe_ros.scene.program import Program
from gdfe_ros.scene.schemas.actuator_schema import ActuatorModel, LoadModel, MassModel, Place
from gdfe_ros.scene.schemas.arm_schema import ArmModel
from gdfe_ros.scene.schemas.material_schema import FibreLayerModel, MaterialModel
from gdfe_ros.scene.schemas.mesh_schema import MeshModel, PlacedMeshModel, SkinModel
from gdfe_ros.scene.schemas.obstacle_schema import BodyModel, ObstacleModel, SelfContactModel, SensorModel
from gdfe_ros.solver.settings import Dynamics, SolverSettings
from gdfe_ros.untrusted.regular_file import NAME_PATTERN

#: Pattern of names, which become parts of ROS topics and of command lines.
NAME = re.compile(r"^[A-Za-z][A-Za-z0-9_]*$")
Name = Annotated[str, StringConstraints(pattern=NAME.pattern)]


class RegionModel(Entry):
    """A material and the cells that have it; a later region replaces the material of an earlier region."""

    material: str = Field(description="name of one of the materials")
    where: Where | None = Field(None, description="the cells (default: all)")


class SoftBodyModel(PlacedMeshModel):
    """A soft body beside the scene's body; it needs `dynamics`, and exactly one of these keys for its mesh."""

    options: ClassVar[tuple[str, ...]] = (*PlacedMeshModel.options, "material", "regions")

    material: str | None = Field(None, description="name of the material of all its cells; either this or `regions`")
    regions: tuple[RegionModel, ...] = Field(
        (), description="the material of each of its cells, as for the scene; places are in the body's own frame"
    )

    _one_of_material_and_regions = one_of(
        "material", "regions", "give exactly one of material and regions, e.g. material: soft"
    )


class HandleModel(Entry):
    """Vertices that are fixed, move together as a rigid body, or slide individually."""

    where: Where = Field(description="the vertices, e.g. {face: x-}")
    fixed: bool = Field(False, description="true: the handle stays at its rest pose and takes no commands")
    free: tuple[Literal["x", "y", "z", "rx", "ry", "rz"], ...] = Field(
        (),
        description="x, y, z: axes along which the handle slides without a force; rx, ry, rz: axes of the world, "
        "through the handle's centre, about which it turns freely. With one or three free turns there is no moment "
        "about them; with two, the rotation vector in their plane has the least energy",
    )

    slide: tuple[Literal["x", "y", "z"], ...] = Field(
        (),
        description="world axes along which each vertex slides by itself, as on rollers; [y, z] is a plane of symmetry "
        "perpendicular to x. Such a handle takes no commands. It may share vertices with other rollers, and with "
        "handles without free axes: there, both hold",
    )

    @model_validator(mode="after")
    def _one_kind(self) -> HandleModel:
        if self.slide and (self.fixed or self.free):
            raise ValueError("slide excludes fixed: true and free axes; leave one of them out")
        if self.fixed and self.free:
            raise ValueError("fixed: true and free axes exclude each other; leave one of the two out")
        return self

    @property
    def axes(self) -> tuple[Axis, ...]:
        """Axes along which the handle slides, in ascending order."""
        return tuple(axis for axis in Axis if axis.name.lower() in self.free)

    @property
    def turning(self) -> tuple[Axis, ...]:
        """Axes about which the handle rotates freely, in ascending order."""
        return tuple(axis for axis in Axis if f"r{axis.name.lower()}" in self.free)


def _with_effect(given: Any, read: Callable[[Any], Dynamics]) -> Dynamics:
    """Return the dynamics; raise an error if the entry gives a `rho_inf` that its scheme ignores."""
    dynamics = read(given)
    if isinstance(given, dict) and "rho_inf" in given:
        dynamics.require_effect()
    return dynamics


class SceneModel(Entry):
    """A scene file."""

    name: Annotated[str, StringConstraints(pattern=NAME_PATTERN)] = Field(
        description="a short name: up to 64 letters, digits, `_`, `-` and `.`; bags and results are named by it"
    )
    description: str = Field("", description="a sentence that describes the scene")
    mesh: MeshModel | None = Field(
        None, description="the body, e.g. bar: {size: [0.2, 0.05, 0.05], cells: [20, 5, 5]}; either this or `meshes`"
    )
    meshes: dict[Name, PlacedMeshModel] = Field(
        {}, description="several bodies by name, instead of `mesh`, e.g. left: {file: finger.msh, at: [0, 0.05, 0]}"
    )
    skin: SkinModel | None = None
    soft_bodies: dict[Name, SoftBodyModel] = Field(
        {},
        description="soft bodies beside the body, by name, e.g. cube: {bar: {...}, material: soft, at: [0, 0, 0.1]}; "
        "a place without the key `mesh` never contains them",
    )
    materials: dict[Name, MaterialModel] = Field(
        description="materials by name, e.g. soft: {law: linear, young: 1.0e5, poisson: 0.45}", min_length=1
    )
    regions: tuple[RegionModel, ...] = Field(
        description="the material of each cell: a list of {material, where}; later entries win", min_length=1
    )
    handles: dict[Name, HandleModel] = Field(
        description="groups of vertices that are held or moved, by name, e.g. base: {where: {face: x-}, fixed: true}"
    )
    obstacles: dict[Name, ObstacleModel] = Field(
        {},
        description="rigid objects that the body cannot enter, by name, e.g. floor: {plane: [0, 0, 1], friction: 0.5}",
    )
    bodies: dict[Name, BodyModel] = Field(
        {},
        description="rigid bodies that move freely, by name, e.g. "
        "part: {box: {size: [0.02, 0.02, 0.02]}, density: 800}",
    )
    arm: ArmModel | None = Field(None, description="an arm whose joints move a handle; its name is `arm`")
    arms: dict[Name, ArmModel] = Field(
        {}, description="several arms by name, instead of `arm`, e.g. left: {urdf: arm.urdf, prefix: left_, ...}"
    )
    actuators: dict[Name, ActuatorModel] = Field(
        {}, description="actuators by name, e.g. tendon: {cable: {points: [...], command: tension}}"
    )
    loads: dict[Name, LoadModel] = Field({}, description="loads by name, e.g. weight: {gravity: [0, 0, -9.81]}")
    masses: dict[Name, MassModel] = Field(
        {}, description="attached masses by name, e.g. payload: {mass: 0.05, where: ...}"
    )
    fibres: dict[Name, FibreLayerModel] = Field(
        {},
        description="thin layers of fibres on the surface, by name, e.g. hoops: {along: [0, 0, 1], angles_deg: [90], "
        "stiffness: 2.0e4, where: ...}",
    )
    probes: dict[Name, Place] = Field(
        {}, description="material points whose positions are reported, by name, e.g. tip: [0.1, 0, 0]"
    )
    sensors: dict[Name, SensorModel] = Field(
        {},
        description="contact sensors, which measure the contact force on some faces, by name, e.g. "
        "pad: {where: {face: x+}}",
    )
    self_contact: SelfContactModel | None = None
    dynamics: Annotated[Dynamics, WrapValidator(_with_effect)] | None = None
    program: Program | None = None
    solver: SolverSettings = SolverSettings()


class Draft(SceneModel):
    """The valid entries of a scene file; they can be checked even if other entries have defects."""

    name: str = ""
    materials: dict[Name, MaterialModel] = Field({})
    regions: tuple[RegionModel | None, ...] = ()
    handles: dict[Name, HandleModel] = Field({})

# SPDX-License-Identifier: Apache-2.0
"""Bodies that join a running scene: read from URDF or YAML, added to the scene's text, and removed from it."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from gdfe_ros.arms.description import Geometry, Link
from gdfe_ros.arms.urdf import parse_urdf
from gdfe_ros.errors import ArmError, MeshError, SceneError
from gdfe_ros.scene.base_entry import VALUE_ERROR
from gdfe_ros.scene.document import parse_document
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.scene.scene import Scene
from gdfe_ros.scene.schemas.mesh_schema import MeshModel
from gdfe_ros.scene.schemas.obstacle_schema import BodyModel
from gdfe_ros.scene.schemas.scene_schema import NAME

SOFT = ("material", "materials", "regions")
"""Keys of materials: a description with one of these keys describes a soft body."""
PLACED = ("at", "rotation_deg")
"""Keys of a body's entry that state its place."""
_TITLE = ("name", "description")
MOST_CELLS = 20_000
"""Largest number of cells of a generated soft body that joins."""
SMALLEST, BIGGEST = 1e-3, 10.0
"""Smallest and largest size of a soft body that joins, divided by the size of the scene's body.

The tolerance of a step is relative to the largest body. If the soft body has a ten-thousandth of the largest body's
size, errors of several tolerances were measured.
"""
LARGEST = 100_000
"""Largest number of characters of a body's description."""
_MOST_VALUES = 1000
"""Largest number of values in a body's description."""
ODD = 0.05
"""Moments of inertia in a URDF that differ from those of a homogeneous body by more than this fraction are reported."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Entity:
    """A body that can join a scene.

    Attributes:
        name: its name in the resource; empty if the resource states none.
        entry: keys and values of its entry in `bodies` or `soft_bodies`, without its pose.
        materials: dict from name to material of a soft body; a single material has an empty name. None for a rigid
            body.
        origin: origin (3,) [m] of the frame of ``entry``, in the frame of the entity.
        axes: rotation (3, 3) of the frame of ``entry``, in the frame of the entity.
        remark: difference between the resource and the body that is simulated; empty if there is none.
    """

    name: str
    entry: dict[str, Any]
    origin: NDArray[np.float64]
    axes: NDArray[np.float64]
    materials: Mapping[str, Any] | None = None
    remark: str = ""

    @property
    def section(self) -> str:
        """Section of a scene file to which `entry` belongs."""
        return "bodies" if self.materials is None else "soft_bodies"


def read_entity(text: str, *, where: str = "the resource") -> Entity:
    """Read a body from a URDF, from a YAML entry as in `bodies`, or from a mesh with its material.

    A soft body is a mesh, as in a scene, with `material` (its law and parameters), or with `materials` and `regions`;
    the mesh may also be under the key `mesh`, as in a scene. A URDF must have one link with one <collision> that is a
    box, a cylinder or a sphere, and with a mass. The body's density is uniform; its coefficient of friction is <mu1> of
    the link's <gazebo> element, or else 0.

    Args:
        text: the URDF or the YAML text.
        where: name of the text in an error.

    Raises:
        ArmError: the URDF has defects, or is not of this kind.
        SceneError: the YAML text is no mapping, states a place, or is too large.
    """
    if len(text) > LARGEST:
        raise SceneError(where, [f"it has {len(text)} characters; allowed: up to {LARGEST}"])
    if text.lstrip().startswith("<"):
        return _from_urdf(text, where)
    entry = parse_document(text, heading=where, most_nodes=_MOST_VALUES).data
    if any(key in entry for key in SOFT):
        return _soft(entry, where)
    _require_unplaced(entry, where)
    return Entity(name="", entry=entry, origin=np.zeros(3), axes=np.eye(3))


def _require_unplaced(entry: Mapping[str, Any], where: str) -> None:
    stated = [key for key in PLACED if key in entry]
    if stated:
        raise SceneError(where, [f"it has {' and '.join(stated)}; remedy: leave it out, initial_pose states the place"])


def _soft(data: Mapping[str, Any], where: str) -> Entity:
    """Return the soft body of a description with materials, and a mesh with its keys or under the key `mesh`."""
    rest = {key: value for key, value in data.items() if key not in (*SOFT, *_TITLE, "mesh", "skin")}
    mesh = data.get("mesh", rest)
    if not isinstance(mesh, dict):
        raise SceneError(where, [f"mesh is {mesh!r}; allowed: one mesh as in a scene, e.g. {{bar: {{...}}}}"])
    if "mesh" in data and rest:
        allowed = ", ".join((*_TITLE, "mesh", "skin", *SOFT))
        raise SceneError(where, [f"it has {', '.join(map(str, rest))}; allowed for a body that joins: {allowed}"])
    _require_unplaced(mesh, where)
    material, materials = data.get("material"), data.get("materials")
    if (material is None) == (materials is None) or not isinstance({} if materials is None else materials, dict):
        text = "give `material`, its law and parameters, or a mapping `materials` with `regions`"
        raise SceneError(where, [text])
    unfit = [str(name) for name in materials or {} if not NAME.fullmatch(str(name))]
    if unfit:
        raise SceneError(where, [f"materials has {', '.join(unfit)}; allowed: letters, digits and _, a letter first"])
    entry = {**mesh, "skin": data["skin"]} if "skin" in data else dict(mesh)
    made_of = {"": material}
    if materials is not None:
        entry["regions"] = data.get("regions")
        made_of = _keep_used(materials, entry["regions"], where)
    elif "regions" in data:
        raise SceneError(
            where, ["it has material and regions; remedy: `materials` with `regions`, or `material` alone"]
        )
    _require_few_cells(mesh, where)
    name = data.get("name", "")
    found = {"name": name if isinstance(name, str) else "", "entry": entry, "materials": made_of}
    return Entity(**found, origin=np.zeros(3), axes=np.eye(3))


def _keep_used(materials: Mapping[str, Any], regions: Any, where: str) -> dict[str, Any]:
    """Return the materials that regions use; unused materials would remain in the scene after the body has left.

    Raises:
        SceneError: the regions are no list, or one names a material that is not the body's own.
    """
    if not isinstance(regions, list):
        raise SceneError(
            where, [f"regions is {regions!r}; allowed: a list, e.g. [{{material: {next(iter(materials), 'gel')}}}]"]
        )
    names = [str(each["material"]) for each in regions if isinstance(each, dict) and "material" in each]
    if foreign := [name for name in names if name not in materials]:
        allowed = ", ".join(map(str, materials)) or "none"
        raise SceneError(where, [f"regions has the material {foreign[0]!r}; allowed: its own materials: {allowed}"])
    return {name: each for name, each in materials.items() if name in names}


def _require_few_cells(mesh: Mapping[str, Any], where: str) -> None:
    """Raise SceneError if a mesh would have too many cells, before it is generated."""
    try:
        count = MeshModel.model_validate(dict(mesh)).count
    except (ValidationError, MeshError):
        return  # loading the scene with this entry names the defects
    if count > MOST_CELLS:
        raise SceneError(where, [f"its mesh has about {count:.0f} cells; allowed for a body that joins: {MOST_CELLS}"])


def with_body(scene: Scene, name: str, entity: Entity, *, origin: NDArray[np.float64], turn: Rotation) -> Scene:
    """Return ``scene`` with the body ``name`` as the last one of its kind.

    The materials of a soft body are added to the scene, with the body's name as prefix.

    Args:
        scene: the scene; it is not changed.
        name: name of the body.
        entity: its shape, mass and friction.
        origin: initial origin (3,) [m] of the entity's frame.
        turn: initial rotation of the entity's frame.

    Raises:
        SceneError: the entry has defects, or the scene cannot be solved with it.
    """
    at, turned = origin + turn.apply(entity.origin), turn * Rotation.from_matrix(entity.axes)
    entry = {**entity.entry, "at": at.tolist(), "rotation_deg": np.degrees(turned.as_rotvec()).tolist()}
    given = {own: f"{name}_{own}" if own else name for own in entity.materials or {}}
    if taken := [each for each in given.values() if each in scene.materials]:
        raise SceneError(f"scene {scene.name}", [f"material {taken[0]!r} exists; remedy: another name for the body"])
    if "regions" in entry:
        entry["regions"] = [_rename(region, given) for region in entry["regions"]]
    elif given:
        entry["material"] = next(iter(given.values()))
    overrides = {f"materials.{given[own]}": material for own, material in (entity.materials or {}).items()}
    joined = scene_from_text(
        scene.source, origin=scene.name, overrides={**overrides, f"{entity.section}.{name}": entry}
    )
    if entity.materials is not None:
        _require_fitting(joined, name, reads="file" in entry)
    return joined


def _require_fitting(scene: Scene, name: str, *, reads: bool) -> None:
    """Raise SceneError if a soft body has too many cells, or is much smaller or larger than the scene's body.

    ``reads`` is whether its mesh comes from a file; the number of cells is then not limited.
    """
    parts, defects = scene.mesh.parts, []
    mesh = parts[name].mesh
    if not reads and mesh.n_cells > MOST_CELLS:
        defects.append(f"its mesh has {mesh.n_cells} cells; allowed for a body that joins: {MOST_CELLS}")
    own = max(part.mesh.size for each, part in parts.items() if each not in scene.soft_bodies)
    if not SMALLEST * own <= mesh.size <= BIGGEST * own:
        allowed = f"{SMALLEST * own:.3g} to {BIGGEST * own:.3g} m, because the scene's body has {own:.3g} m"
        defects.append(f"its size is {mesh.size:.3g} m; allowed for a body that joins: {allowed}")
    if defects:
        raise SceneError(f"body {name}", defects)


def _rename(region: Any, names: Mapping[str, str]) -> Any:
    """Return a region with the name of its material in the scene; invalid regions are left to the loader's checks."""
    if not isinstance(region, dict) or not isinstance(region.get("material"), str):
        return region
    return {**region, "material": names.get(region["material"], region["material"])}


def without_bodies(scene: Scene, names: Collection[str]) -> Scene:
    """Return ``scene`` without the bodies in ``names``, and without the materials that joined with soft bodies."""
    document = parse_document(scene.source, heading=f"scene {scene.name}").data
    gone: dict[str, None] = {}
    for name in names:
        soft = document.get("soft_bodies", {}).get(name)
        gone |= {f"{'bodies' if soft is None else 'soft_bodies'}.{name}": None}
        used = [] if soft is None else [soft.get("material"), *(each["material"] for each in soft.get("regions", ()))]
        own = [each for each in used if each is not None and (each == name or each.startswith(f"{name}_"))]
        gone |= {f"materials.{each}": None for each in own}  # they came with the body
    return scene_from_text(scene.source, origin=scene.name, overrides=gone)


def _from_urdf(text: str, where: str) -> Entity:
    robot = parse_urdf(text, where=where)
    if len(robot.links) != 1:
        names = ", ".join(robot.links)
        text = f"it has the links {names}; allowed: one link, because only rigid bodies can join a scene"
        raise ArmError(where, [f"{text}; remedy for a robot: `arm` in the scene file"])
    link = next(iter(robot.links.values()))
    element = ElementTree.fromstring(robot.text)  # this text declares its prefixes
    stated = element.find("link/inertial/mass")
    mass = 0.0 if stated is None else float(stated.get("value"))
    if not mass > 0.0:
        raise ArmError(where, [f'link {link.name!r} has no mass; remedy: <inertial> with <mass value="0.05"/>'])
    shape = _only_shape(link, where)
    entry = {type(shape.form).__name__.lower(): asdict(shape.form), "mass": mass}
    friction = element.find("gazebo/mu1")
    if friction is not None:
        entry["friction"] = _friction(friction.text, where)
    try:
        form = BodyModel.model_validate(entry).form
    except ValidationError as error:
        found = ((".".join(map(str, each["loc"])), each["msg"].removeprefix(VALUE_ERROR)) for each in error.errors())
        raise ArmError(where, [": ".join(defect) for defect in found]) from error
    return Entity(
        name=robot.name,
        entry=entry,
        origin=shape.origin,
        axes=shape.axes,
        remark=_remark(element.find("link/inertial/inertia"), mass * (form.moments.sum() - form.moments)),
    )


def _friction(text: str | None, where: str) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not 0.0 <= value <= math.inf:
        raise ArmError(where, [f"<mu1> is {text!r}; allowed: a number, 0 or more"])
    return value


def _only_shape(link: Link, where: str) -> Geometry:
    if len(link.collisions) != 1:
        text = f"link {link.name!r} has {len(link.collisions)} elements <collision>; allowed: one"
        raise ArmError(where, [text])
    shape = link.collisions[0]
    if shape.form is None:
        text = "its <collision> is a mesh; allowed: box, cylinder, sphere"
        remedy = "remedy: the YAML text `mesh: {file: /path/part.stl}` with `mass` or `density` as the resource"
        raise ArmError(where, [f"{text}; {remedy}"])
    return shape


def _remark(inertia: ElementTree.Element, own: NDArray[np.float64]) -> str:
    """Return a text about moments of inertia that differ from ``own`` (3,) [kg m^2]; empty if they agree."""
    xx, xy, xz, yy, yz, zz = (float(inertia.get(part, 0.0)) for part in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    given, own = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), np.sort(own)
    if np.abs(given - own).max() <= ODD * own.max():
        return ""
    shown = (", ".join(f"{value:.3g}" for value in values) for values in (given, own))
    return "its principal moments are {} kg m^2; the simulated ones are those of a homogeneous body, {}".format(*shown)

# SPDX-License-Identifier: Apache-2.0
"""Construction of arms from the valid parts of a scene file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.arms.arm import Arm
from gdfe_ros.arms.description import Description, Joint
from gdfe_ros.arms.dynamics import LinkDynamics, LinkFrame
from gdfe_ros.arms.joint_limits import JointSprings
from gdfe_ros.arms.meshes import find_mesh, read_surface, remark_on_package
from gdfe_ros.arms.shapes import begins_inside, touching_links, visuals
from gdfe_ros.arms.urdf import parse_urdf
from gdfe_ros.constraints import Handle
from gdfe_ros.errors import ArmError, MeshError
from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.files.stored_mesh import pack_robot, unpack_robot
from gdfe_ros.scene.building.builder import KINDS
from gdfe_ros.scene.document import Carried, KeyPath, without
from gdfe_ros.scene.report import Defects, require_known, suggest
from gdfe_ros.scene.schemas.arm_schema import ArmModel
from gdfe_ros.scene.schemas.scene_schema import Draft
from gdfe_ros.untrusted.bounded_text import LARGEST_XML
from gdfe_ros.untrusted.regular_file import read_text

SPIN_UP = 0.1
"""Time [s] in which a joint reaches its largest velocity if no limit of its acceleration is given."""
ONE = "arm"
"""Name of the single arm that the key `arm` describes."""


def require_arms(data: Mapping[str, Any], report: Defects) -> None:
    """Report a defect if a scene has both `arm` and `arms`."""
    if "arm" in data and "arms" in data:
        text = "`arm` is there, too; remedy: keep one of the two; `arms` may contain a single arm"
        report.refuse(("arms",), text)


def arm_models(draft: Draft) -> dict[str, tuple[KeyPath, ArmModel]]:
    """Return a dict from the name of each valid arm of a file to its key path and its entry."""
    one = {} if draft.arm is None else {ONE: ((ONE,), draft.arm)}
    return one | {name: (("arms", name), model) for name, model in draft.arms.items()}


def build_arms(
    draft: Draft, mesh: HexMesh | None, handles: Sequence[Handle], carried: Carried, report: Defects
) -> tuple[Arm, ...]:
    """Return the valid arms."""
    arms: list[Arm] = []
    for name, (path, model) in arm_models(draft).items() if mesh is not None else ():
        built = _Builder(name, path, model, report)
        arm = built.arm(mesh, handles, list(draft.handles))
        if arm is not None:
            arms.append(arm)
            carried |= built.embedded()
    _require_distinct(arms, draft, report)
    return tuple(arms)


def joint_starts(arms: Sequence[Arm]) -> dict[str, float]:
    """Return a dict from the name of each commanded joint to its initial position [rad] or [m]."""
    return {joint.name: float(value) for arm in arms for joint, value in zip(arm.joints, arm.start, strict=True)}


class _Builder:
    """Builder of one arm."""

    def __init__(self, name: str, path: KeyPath, model: ArmModel, report: Defects) -> None:
        self._name, self._path, self._model, self._report = name, path, model, report
        self._text, self._surfaces = "", {}

    def arm(self, mesh: HexMesh, handles: Sequence[Handle], known: Sequence[str]) -> Arm | None:
        """Return the arm; if it has defects, report them and return None."""
        model, key = self._model, "urdf" if self._model.urdf is not None else "embedded"
        handle = next((item for item in handles if item.name == model.handle), None)
        self._check_handle(handle, known)
        try:
            robot = self._read()
            self._require_flange(robot)
            start, springs = self._start(robot), self._springs(robot)
            touching = self._touching(robot)
            remarks = self._load_meshes(robot, touching)
            turn = Rotation.from_rotvec(np.radians(model.rotation_deg)).as_matrix()
            dynamics = LinkDynamics(robot, LinkFrame(np.array(model.at), turn))
            if handle is None or start is None or model.flange not in robot.links:
                return None
            rest = dynamics.frames(start)
            given = {"surfaces": self._surfaces, "rest": rest, "friction": model.friction}
            links, debris = touching_links(self._name, robot, touching, **given)
            shapes = visuals(robot, self._surfaces)
        except (ArmError, MeshError) as error:
            for defect in error.defects:
                self._refuse(defect, key)
            return None
        arm = Arm(
            name=self._name,
            dynamics=dynamics,
            flange=model.flange,
            handle=model.handle,
            centre=handle.centre(mesh.vertices),
            start=start,
            springs=springs,
            links=links,
            visuals=shapes,
            remarks=(*robot.remarks, *remarks, *debris),
        )
        for text in begins_inside(arm, handles, mesh):
            self._refuse(text, "start")
        return arm

    def _refuse(self, text: str, *keys: str) -> None:
        """Report a defect at a key of the arm."""
        self._report.refuse((*self._path, *keys), text)

    def embedded(self) -> Carried:
        """Return the arm's entry with the contents of its files, in a dict by key path; empty if it reads no file."""
        if self._model.urdf is None:
            return {}
        entry = without(self._report.value_at(self._path, plain=False), "urdf", "packages")
        return {self._path: entry | {"embedded": pack_robot(self._text, self._surfaces)}}

    def _read(self) -> Description:
        model = self._model
        if model.urdf is None:
            self._text, self._surfaces = unpack_robot(model.embedded)
            where = "the embedded URDF"
        else:
            where = f"URDF {model.urdf}"
            try:
                self._text = read_text(model.urdf, most=LARGEST_XML, encoding="utf-8-sig")
            except (OSError, UnicodeDecodeError) as error:
                raise ArmError(
                    where, [f"it cannot be read as text: {error}; remedy: the path of a URDF file"]
                ) from error
        limits = {name: item.model_dump(exclude_none=True) for name, item in model.limits.items()}
        robot = parse_urdf(self._text, where=where, prefix=model.prefix, limits=limits, velocity=model.velocity)
        joints = {name: self._limit(joint) for name, joint in robot.joints.items()}
        return replace(robot, joints=joints)

    def _limit(self, joint: Joint) -> Joint:
        """Return the joint with a limit of its acceleration: its own limit, else the arm's, else one from `SPIN_UP`."""
        limits = joint.limits
        if limits is None or np.isfinite(limits.acceleration):
            return joint
        usual = self._model.acceleration or limits.velocity / SPIN_UP
        return replace(joint, limits=replace(limits, acceleration=usual))

    def _load_meshes(self, robot: Description, touching: Sequence[str]) -> tuple[str, ...]:
        """Read the surface of each mesh, or take it from the packed URDF; return remarks on unreadable meshes.

        Meshes of links in contact must be readable. The other meshes only appear in pictures, and are left out if they
        cannot be read.

        Raises:
            ArmError: meshes of contact are missing or unreadable; the error names all of them.
        """
        model, needed, defects, remarks = self._model, robot.collision_files(touching), [], []
        for uri in robot.mesh_files():
            try:
                if model.urdf is not None:
                    path = find_mesh(uri, folder=model.urdf.parent, packages=model.packages)
                    self._surfaces[uri] = read_surface(uri, path)
                    remarks += remark_on_package(uri, path, packages=model.packages)
                elif uri not in self._surfaces:
                    raise ArmError(uri, ["it is not in the recorded scene"])
            except ArmError as error:
                if uri in needed:
                    remedy = "or leave its link out of `links`"
                    defects += [f"mesh {uri}: {defect}, {remedy}" for defect in error.defects]
                else:
                    remarks += [f"mesh {uri} is left out of pictures: {defect}" for defect in error.defects]
        if defects:
            raise ArmError(f"URDF {model.urdf}", defects)
        return tuple(dict.fromkeys(remarks))

    def _check_handle(self, handle: Handle | None, known: Sequence[str]) -> None:
        path = (*self._path, "handle")
        if handle is None:
            with self._report.entry(*path):
                require_known("", "handle", self._model.handle, known)
        elif handle.fixed or handle.loose:
            text = "this handle is fixed or has free axes, but an arm prescribes its whole pose"
            self._report.refuse(path, f"{text}; remedy: remove `fixed` and `free` from it")

    def _require_flange(self, robot: Description) -> None:
        if self._model.flange not in robot.links:
            self._report.add(
                (*self._path, "flange"), f"the URDF has no such link{suggest(self._model.flange, robot.links)}"
            )
        elif not any(joint.moves for joint in robot.chain(self._model.flange)):
            text = f"no joint moves between {robot.root!r} and this link; remedy: a link beyond the last joint"
            self._report.add((*self._path, "flange"), text)

    def _start(self, robot: Description) -> NDArray[np.float64] | None:
        """Return the initial positions [rad] or [m] of the commanded joints; None if there are defects."""
        joints = {joint.name: joint for joint in robot.commanded}
        sound, starts = self._require_joints("start", self._model.start, robot), dict(self._model.start)
        for joint in joints.values():
            value, limits = self._model.start.get(joint.name), joint.limits
            if value is None:
                starts[joint.name] = min(max(0.0, limits.lower), limits.upper)
            elif not limits.lower <= value <= limits.upper:
                sound = False
                allowed = f"allowed by its limits: {limits.lower:g} to {limits.upper:g} {joint.unit}"
                self._refuse(f"{value!r}; {allowed}", "start", joint.name)
        return np.array([float(starts[name]) for name in joints]) if sound else None

    def _springs(self, robot: Description) -> JointSprings | None:
        """Return the springs of the joints; None if all joints are rigid."""
        joints, given = [joint.name for joint in robot.commanded], self._model.compliance
        self._require_joints("compliance", given, robot)
        rows = [(place, given[name]) for place, name in enumerate(joints) if name in given]
        if not rows:
            return None
        return JointSprings(
            yielding=np.array([place for place, _ in rows]),
            stiffness=np.array([model.stiffness for _, model in rows]),
            damping=np.array([model.damping for _, model in rows]),
        )

    def _require_joints(self, key: str, names: Iterable[str], robot: Description) -> bool:
        """Report the names below ``key`` that are not commanded joints; return whether all names are."""
        joints = [joint.name for joint in robot.commanded]
        followers = {joint.name: joint.mimic.joint for joint in robot.joints.values() if joint.mimic is not None}
        unknown = [name for name in names if name not in joints]
        for name in unknown:
            text = f"there is no such joint{suggest(name, joints)}"
            if name in followers:
                text = f"this joint follows {followers[name]!r} (mimic) and has no motor; remedy: {followers[name]}"
            self._refuse(text, key, name)
        return not unknown

    def _touching(self, robot: Description) -> list[str]:
        """Return the names of the links in contact.

        The key `links` lists them. By default, they are all links with a collision shape, except those that fixed
        joints connect with the flange.
        """
        given = self._model.links
        if given is None:
            mounted = robot.rigid_with(self._model.flange)
            return [name for name, link in robot.links.items() if link.collisions and name not in mounted]
        for name in given:
            if name not in robot.links:
                self._refuse(f"there is no link {name!r}{suggest(name, robot.links)}", "links")
            elif not robot.links[name].collisions:
                text = f"link {name!r} has no <collision>; remedy: leave it out, or give it one"
                self._refuse(text, "links")
        return [name for name in given if name in robot.links]


def _require_distinct(arms: Sequence[Arm], draft: Draft, report: Defects) -> None:
    """Report arms with the same handle, and joints or links with the name of another item of the scene."""
    taken = {name: kind for section, kind in KINDS.items() for name in getattr(draft, section)}
    owners: dict[str, str] = {}
    handles: dict[str, str] = {}
    paths = {name: path for name, (path, _) in arm_models(draft).items()}
    for arm in arms:
        if arm.handle in handles:
            text = f"arm {handles[arm.handle]!r} carries it already; remedy: a handle of its own for each arm"
            report.add((*paths[arm.name], "handle"), text)
        handles[arm.handle] = arm.name
        names = [joint.name for joint in arm.joints] + list(arm.dynamics.description.links)
        names += [piece.name for piece in arm.links]
        for name in names:
            if owner := f"arm {owners[name]!r}" if name in owners else taken.get(name):
                remedy = f"remedy: `prefix: {arm.name}_`"
                report.refuse(paths[arm.name], f"{owner} has the name {name!r}, too; {remedy}")
                break
        owners |= dict.fromkeys(names, arm.name)

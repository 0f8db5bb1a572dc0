# SPDX-License-Identifier: Apache-2.0
"""Parser of URDF text, which reports every defect with a remedy."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from gdfe_ros.arms.description import Description, Geometry, Joint, JointKind, Link, Mimic, UrdfLimits
from gdfe_ros.arms.tree import mimic_defects, root_of
from gdfe_ros.constraints.form import Box, Cylinder, Sphere
from gdfe_ros.errors import ArmError
from gdfe_ros.untrusted.bounded_text import parse_xml
from gdfe_ros.untrusted.spelling import did_you_mean

_NAMED = {"link": ("name",), "joint": ("name",), "parent": ("link",), "child": ("link",), "mimic": ("joint",)}
"""Dict from XML element to the attribute that contains the name of a link or a joint."""
_XACRO = re.compile(r"\{[^}]*xacro[^}]*\}", re.IGNORECASE)
"""Tag prefix of xacro's elements; the namespace has several spellings. URDFs written by xacro declare the namespace,
but have no such elements.
"""
_PREFIXED = re.compile(r"[\s<]([A-Za-z_][\w.-]*):[A-Za-z_][\w.-]*[\s=/>]")
"""Prefix of an element or attribute, e.g. of ``drake:acceleration``."""
_MACROS = "it has xacro macros; remedy: `xacro arm.urdf.xacro > arm.urdf`, and give that file"
_FORMS = {"box": Box, "cylinder": Cylinder, "sphere": Sphere, "mesh": None}
"""Dict from XML element to the class of its shape, whose fields are the element's attributes; None for a mesh file."""

_SLACK = 1e-6
"""Excess [rad, m, rad/s, m/s] over limits of a joint that mimics another one, up to which there is no remark."""


def parse_urdf(
    text: str,
    *,
    where: str = "the URDF",
    prefix: str = "",
    limits: Mapping[str, Mapping[str, float]] | None = None,
    velocity: float | None = None,
) -> Description:
    """Return the robot that a URDF describes.

    Args:
        text: the URDF.
        where: name of the URDF in an error.
        prefix: text before the name of every link and joint, so that the names of two equal arms differ.
        limits: dict from joint (with the prefix) to values of `UrdfLimits` that replace those of the URDF.
        velocity: largest velocity [rad/s] or [m/s] of joints for which the URDF states none, or zero.

    Raises:
        ArmError: the URDF has defects; each is listed with a remedy.
    """
    try:
        robot = parse_xml(_bind_prefixes(text))
    except ValueError as error:
        if "xacro:" in text:
            raise ArmError(where, [_MACROS]) from error
        raise ArmError(where, [f"this is not XML: {error}; remedy: `xmllint` on the file names the place"]) from error
    if robot.tag != "robot":
        raise ArmError(where, [f"the outermost element is <{robot.tag}>; allowed: <robot>, as in every URDF"])
    if _has_macros(robot):
        raise ArmError(where, [_MACROS])
    _add_prefix(robot, prefix)
    return _Reader(where, limits or {}, velocity).description(robot)


def _bind_prefixes(text: str) -> str:
    """Return the URDF with a declaration of each XML prefix; many URDFs lack them, because ROS' parser ignores them."""
    used = set(_PREFIXED.findall(text)) - set(re.findall(r"xmlns:([\w.-]+)", text)) - {"xmlns", "xml"}
    declared = "".join(f' xmlns:{name}="{name}"' for name in sorted(used))
    return re.sub(r"<robot\b", lambda found: found[0] + declared, text, count=1)


def _has_macros(robot: Element) -> bool:
    """Return whether an element belongs to xacro, or an attribute has an expression or argument of xacro."""
    return any(
        _XACRO.match(str(element.tag)) is not None
        or any("${" in value or "$(" in value for value in element.attrib.values())
        for element in robot.iter()
    )


def _add_prefix(robot: Element, prefix: str) -> None:
    for element in robot.iter() if prefix else ():
        for attribute in _NAMED.get(element.tag, ()):
            if attribute in element.attrib:
                element.set(attribute, prefix + element.get(attribute))


class _Reader:
    """Parser of one robot, which collects all defects."""

    def __init__(self, where: str, limits: Mapping[str, Mapping[str, float]], velocity: float | None) -> None:
        self._where, self._limits, self._velocity, self._defects = where, limits, velocity, []
        self._unlimited: list[str] = []
        self._remarks: list[str] = []

    def description(self, robot: Element) -> Description:
        colours = {item.get("name"): _colour(item) for item in robot.findall("material")}
        links = [self._link(item, colours) for item in robot.findall("link")]
        joints = [joint for item in robot.findall("joint") if (joint := self._joint(item)) is not None]
        if self._unlimited:
            noun, verb = ("joint", "has") if len(self._unlimited) == 1 else ("joints", "have")
            text = f"the {noun} {', '.join(self._unlimited)} {verb} no largest velocity"
            remedy = "remedy: `velocity: 2.0` [rad/s, m/s] in the arm's entry of the scene, for all of them"
            self._add(f'{text}; {remedy}, or <limit velocity="2.0" .../> in the URDF')
        self._require_unique("link", [link.name for link in links])
        self._require_unique("joint", [joint.name for joint in joints])
        by_name = {joint.name: joint for joint in joints}
        root, loops = root_of({link.name for link in links}, joints)
        self._defects += loops + mimic_defects(by_name)
        self._check_limits(by_name)
        if self._defects:
            raise ArmError(self._where, self._defects)
        self._remarks += [text for item in robot.findall("joint") if (text := _exceeded(item, by_name))]
        text = ElementTree.tostring(robot, encoding="unicode")
        given = {"links": {link.name: link for link in links}, "joints": by_name, "remarks": tuple(self._remarks)}
        return Description(name=robot.get("name", "arm"), text=text, root=root, **given)

    def _check_limits(self, joints: Mapping[str, Joint]) -> None:
        """Add a defect for each limit of the scene whose joint is missing, fixed or mimics another one."""
        movable = [joint.name for joint in joints.values() if joint.moves and joint.mimic is None]
        for name in self._limits:
            if name in joints and (mimic := joints[name].mimic) is not None:
                text = f"joint {name!r} follows {mimic.joint!r} (mimic), whose limits hold for both"
                self._add(f"limits: {text}; remedy: limits of {mimic.joint!r} instead")
            elif name not in movable:
                hint = did_you_mean(name, movable)
                self._add(
                    f"limits: there is no joint {name!r} that moves; {hint}joints: {', '.join(movable) or 'none'}"
                )

    def _add(self, defect: str) -> None:
        self._defects.append(defect)

    def _require_unique(self, noun: str, names: Iterable[str]) -> None:
        names = list(names)
        for name in dict.fromkeys(names):
            if names.count(name) > 1:
                self._add(f"{noun} {name!r} is there {names.count(name)} times; remedy: another name for all but one")

    def _link(self, item: Element, colours: Mapping[str | None, Any]) -> Link:
        name = item.get("name", "")
        if not name:
            self._add('a <link> has no name; remedy: name="..."')
        shapes = {
            tag: tuple(
                shape
                for part in item.findall(tag)
                if (shape := self._geometry(part, f"link {name!r}, <{tag}>", colours)) is not None
            )
            for tag in ("visual", "collision")
        }
        pictures = [text for text in self._defects if text.startswith(f"link {name!r}, <visual>")]
        self._defects = [text for text in self._defects if text not in pictures]
        self._remarks += [f"left out of pictures: {text}" for text in pictures]
        inertial = item.find("inertial")
        if inertial is not None:
            self._check_inertial(inertial, name)
        return Link(name=name, visuals=shapes["visual"], collisions=shapes["collision"])

    def _check_inertial(self, inertial: Element, name: str) -> None:
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        value = math.nan if mass is None else self._number(mass, "value", f"link {name!r}, <mass>")
        if mass is None or value < 0.0:
            self._add(f'link {name!r}: its <inertial> has no mass of 0 kg or more; remedy: <mass value="1.0"/>')
        if inertia is None:
            self._add(f"link {name!r}: its <inertial> has no <inertia>; remedy: ixx ixy ixz iyy iyz izz in kg m^2")
            return
        parts = [self._number(inertia, part, f"link {name!r}, <inertia>", 0.0) for part in
                 ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")]  # fmt: skip
        if np.isfinite(parts).all() and value > 0.0:
            xx, xy, xz, yy, yz, zz = parts
            least = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            if least[0] < -1e-9 * max(least[2], 1e-12) or least[0] + least[1] < (1.0 - 1e-6) * least[2]:
                text = f"principal moments {', '.join(f'{part:.3g}' for part in least)} kg m^2 belong to no rigid body"
                remedy = "remedy: each at most the sum of the two others; until then efforts in motion are as wrong"
                self._remarks.append(f"link {name!r}: its {text}; {remedy}")

    def _geometry(self, part: Element, where: str, colours: Mapping[str | None, Any]) -> Geometry | None:
        shape = part.find("geometry")
        found = None if shape is None else next(iter(shape), None)
        if found is None or found.tag not in _FORMS:
            given = "no shape" if found is None else f"<{found.tag}>"
            self._add(f"{where}: its <geometry> has {given}; allowed: {', '.join(f'<{kind}>' for kind in _FORMS)}")
            return None
        form, origin = _FORMS[found.tag], part.find("origin")
        place, axes = self._place(origin, where)
        material = part.find("material")
        colour = None if material is None else _colour(material) or colours.get(material.get("name"))
        given = {"origin": place, "axes": axes, "colour": colour}
        if form is None:
            if not found.get("filename"):
                self._add(f'{where}: its <mesh> has no filename; remedy: filename="package://.../arm.stl"')
                return None
            scale = self._vector(found, "scale", where, (1.0, 1.0, 1.0))
            return Geometry(file=found.get("filename"), scale=scale, **given)
        if form is Box:
            numbers = self._vector(found, "size", where, None)
        else:
            numbers = tuple(self._number(found, item.name, where) for item in fields(form))
        if not all(number > 0.0 for number in numbers):
            self._add(f"{where}: <{found.tag}> has the sizes {numbers}; allowed: lengths above 0 m")
            return None
        return Geometry(form=form(numbers) if form is Box else form(*numbers), **given)

    def _joint(self, item: Element) -> Joint | None:
        name, kind = item.get("name", ""), item.get("type", "")
        where = f"joint {name!r}"
        ends = [item.find(tag).get("link", "") if item.find(tag) is not None else "" for tag in ("parent", "child")]
        if not all(ends):
            self._add(f"{where}: it lacks <parent link=...> or <child link=...>")
        if kind not in [motion.value for motion in JointKind]:
            remedy = "remedy: replace it by revolute and prismatic ones with links without mass between them"
            self._add(f"{where}: its type is {kind!r}; allowed: fixed, revolute, continuous, prismatic; {remedy}")
            return Joint(name=name, motion=JointKind.FIXED, parent=ends[0], child=ends[1])
        motion = JointKind(kind)
        self._place(item.find("origin"), where)
        axis = item.find("axis")
        turns = motion is not JointKind.FIXED and axis is not None
        if turns and not any(self._vector(axis, "xyz", f"{where}, <axis>", (1.0, 0.0, 0.0))):
            self._add(f'{where}: its axis is zero; remedy: a direction, e.g. <axis xyz="0 0 1"/>')
        mimic, limits = self._mimic(item.find("mimic"), where), None
        if motion is not JointKind.FIXED and mimic is None:
            limits = self._joint_limits(item.find("limit"), name, motion)
        return Joint(name=name, motion=motion, parent=ends[0], child=ends[1], limits=limits, mimic=mimic)

    def _mimic(self, item: Element | None, where: str) -> Mimic | None:
        if item is None:
            return None
        multiplier, offset = (self._number(item, part, where, default) for part, default in
                              (("multiplier", 1.0), ("offset", 0.0)))  # fmt: skip
        return Mimic(joint=item.get("joint", ""), multiplier=multiplier, offset=offset)

    def _joint_limits(self, item: Element | None, name: str, motion: JointKind) -> UrdfLimits | None:
        where, own = f"joint {name!r}", dict(self._limits.get(name, {}))
        for part in ("lower", "upper", "velocity", "acceleration", "effort"):
            if item is not None and item.get(part) is not None:
                own.setdefault(part, self._number(item, part, f"{where}, <limit>"))
        if motion is JointKind.CONTINUOUS:
            own.setdefault("lower", -math.inf)
            own.setdefault("upper", math.inf)
        # Many URDFs state 0 for an effort or velocity that nobody knows; a joint that cannot move is fixed.
        if not own.get("velocity", 0.0) > 0.0 and not math.isnan(own.get("velocity", 0.0)):
            own["velocity"] = self._velocity or math.inf
            if self._velocity is None:
                self._unlimited.append(name)
        missing = [part for part in ("lower", "upper") if part not in own]
        if missing:
            example = '<limit lower="-3.1" upper="3.1" velocity="2.0" effort="50"/>'
            given = ", ".join(f"{part}: 1.0" for part in missing)
            remedy = f"remedy: {example} in the URDF, or `limits: {{{name}: {{{given}}}}}` in the scene"
            self._add(f"{where}: it has no limit {', '.join(missing)}; {remedy}")
            return None
        own.setdefault("acceleration", math.inf)
        own.setdefault("effort", math.inf)
        if not own["lower"] <= own["upper"]:
            self._add(f"{where}: its lower limit {own['lower']:g} is above its upper one, {own['upper']:g}")
        for part in ("acceleration", "effort"):
            own[part] = own[part] if own[part] > 0.0 else math.inf
        return UrdfLimits(**own)

    def _place(self, origin: Element | None, where: str) -> tuple[np.ndarray, np.ndarray]:
        if origin is None:
            return np.zeros(3), np.eye(3)
        zero = (0.0, 0.0, 0.0)
        xyz, rpy = (self._vector(origin, part, f"{where}, <origin>", zero) for part in ("xyz", "rpy"))
        return np.array(xyz), Rotation.from_euler("xyz", np.nan_to_num(rpy)).as_matrix()

    def _number(self, item: Element, name: str, where: str, default: float | None = None) -> float:
        text = item.get(name)
        if text is None and default is not None:
            return default
        try:
            value = float(text if text is not None else "")
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            self._add(f"{where}: {name} is {text!r}; allowed: a finite number")
        return value

    def _vector(
        self, item: Element, name: str, where: str, default: tuple[float, ...] | None
    ) -> tuple[float, float, float]:
        text = item.get(name)
        if text is None and default is not None:
            return default
        try:
            values = tuple(map(float, (text or "").split()))
        except ValueError:
            values = ()
        if len(values) != 3 or not all(map(math.isfinite, values)):
            self._add(f"{where}: {name} is {text!r}; allowed: three finite numbers")
            return default or (math.nan, math.nan, math.nan)
        return values


def _exceeded(item: Element, joints: Mapping[str, Joint]) -> str:
    """Return a remark if a joint that mimics another one can exceed its <limit>, which is ignored; otherwise ''."""
    joint, limit = joints[item.get("name")], item.find("limit")
    if joint.mimic is None or limit is None:
        return ""
    lead, factor = joints[joint.mimic.joint].limits, joint.mimic.multiplier
    low, high = sorted(factor * end + joint.mimic.offset for end in (lead.lower, lead.upper))
    speed, found = abs(factor) * lead.velocity, []
    for part, reached, sign in (("lower", low, -1.0), ("upper", high, 1.0), ("velocity", speed, 1.0)):
        try:
            own = float(limit.get(part, ""))
        except ValueError:
            continue
        if sign * (reached - own) > _SLACK and (part != "velocity" or own > 0.0):
            found.append(f"{part} {own:g} (it reaches {reached:g})")
    text = f"joint {joint.name!r} follows {joint.mimic.joint!r} (mimic) beyond its ignored <limit>: {', '.join(found)}"
    return f"{text}; remedy: `limits` of {joint.mimic.joint} in the scene" if found else ""


def _colour(material: Element) -> tuple[float, float, float] | None:
    item = material.find("color")
    if item is None:
        return None
    try:
        values = tuple(map(float, item.get("rgba", "").split()))
    except ValueError:
        return None
    return values[:3] if len(values) == 4 else None

# SPDX-License-Identifier: Apache-2.0
"""Kinematics and dynamics of an arm, computed by pinocchio."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.arms.description import Description, JointKind
from gdfe_ros.errors import ArmError

Vector = NDArray[np.float64]
CONTINUOUS_LIMIT = 1e9
"""Limit [rad] of continuous joints in pinocchio: they are passed as revolute joints, which have one coordinate."""


class LinkFrame(NamedTuple):
    """Frame of a link in the world: origin (3,) [m] and rotation (3, 3)."""

    origin: Vector
    axes: Vector


class Push(NamedTuple):
    """A wrench in the world's axes: force (3,) [N], and moment (3,) [N m] about a point (3,) [m]."""

    force: Vector
    moment: Vector
    point: Vector


class LinkDynamics:
    """Kinematics and dynamics of an arm of rigid links.

    q (n,) are the positions of the commanded joints; joints that mimic others follow them. The efforts of the motors
    are

        tau = M(q) q'' + C(q, q') q' + g(q) - sum_k J_k^T w_k

    w_k is the wrench on link k, and J_k the Jacobian of the link's frame. The first three terms come from the recursive
    Newton-Euler algorithm (Featherstone, *Rigid Body Dynamics Algorithms*, 2008, section 5.3).

    Args:
        description: description of the robot.
        base: frame of the robot's root link in the world.

    Raises:
        ArmError: pinocchio is not installed, or refuses the description.
    """

    def __init__(self, description: Description, base: LinkFrame) -> None:
        self.description, self.base = description, base
        self.joints = description.commanded
        self._pin = pin = _pinocchio()
        try:
            self._model = pin.buildModelFromXML(_plain(description))
        except (ValueError, RuntimeError) as error:
            raise ArmError(f"robot {description.name}", [f"pinocchio refuses it: {error}"]) from error
        self._data = self._model.createData()
        self._spread, self._offset = self._couplings()
        body = pin.FrameType.BODY  # a joint may have the name of a link
        self._frames = {name: self._model.getFrameId(name, body) for name in description.links}

    def _couplings(self) -> tuple[Vector, Vector]:
        """Return S (m, n) and o (m,): the positions of pinocchio's m joints, mimic joints included, are S q + o."""
        places = {name: self._model.joints[self._model.getJointId(name)].idx_q for name in self.description.joints
                  if self._model.existJointName(name)}  # fmt: skip
        columns = {joint.name: place for place, joint in enumerate(self.joints)}
        spread, offset = np.zeros((self._model.nq, len(self.joints))), np.zeros(self._model.nq)
        for name, row in places.items():
            mimic = self.description.joints[name].mimic
            source = name if mimic is None else mimic.joint
            spread[row, columns[source]] = 1.0 if mimic is None else mimic.multiplier
            offset[row] = 0.0 if mimic is None else mimic.offset
        return spread, offset

    def frames(self, q: Vector) -> dict[str, LinkFrame]:
        """Return a dict from link to its frame in the world, at joint positions ``q`` (n,) [rad] or [m]."""
        self._pin.framesForwardKinematics(self._model, self._data, self._full(q))
        found = {}
        for name, number in self._frames.items():
            place = self._data.oMf[number]
            origin = self.base.origin + self.base.axes @ place.translation
            found[name] = LinkFrame(origin, self.base.axes @ place.rotation)
        return found

    def efforts(self, q: Vector, v: Vector, a: Vector, *, gravity: Vector, pushes: Mapping[str, Push]) -> Vector:
        """Return the efforts of the commanded joints (n,) [N m] or [N].

        Args:
            q: positions (n,) [rad] or [m].
            v: velocities (n,) [rad/s] or [m/s].
            a: accelerations (n,) [rad/s^2] or [m/s^2].
            gravity: acceleration (3,) [m/s^2] in the world.
            pushes: dict from link to the wrench on it.
        """
        self._model.gravity.linear = self.base.axes.T @ gravity
        rates = self._spread @ v, self._spread @ a
        full = self._full(q)
        efforts = self._pin.rnea(self._model, self._data, full, *rates).copy()
        if pushes:
            self._pin.computeJointJacobians(self._model, self._data, full)
            self._pin.updateFramePlacements(self._model, self._data)
        axes = self._pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        for name, push in pushes.items():
            jacobian = self._pin.getFrameJacobian(self._model, self._data, self._frames[name], axes)
            efforts -= jacobian.T @ self._wrench(name, push)
        return self._spread.T @ efforts

    def mass_matrix(self, q: Vector) -> Vector:
        """Return the mass matrix M (n, n) [kg m^2] or [kg] of the commanded joints."""
        upper = np.triu(self._pin.crba(self._model, self._data, self._full(q)))
        return self._spread.T @ (upper + np.triu(upper, 1).T) @ self._spread

    def kinetic_energy(self, q: Vector, v: Vector) -> float:
        """Return the kinetic energy of the links [J]."""
        return float(self._pin.computeKineticEnergy(self._model, self._data, self._full(q), self._spread @ v))

    def potential_energy(self, q: Vector, gravity: Vector) -> float:
        """Return the potential energy [J] of the links under ``gravity`` (3,) [m/s^2]."""
        self._model.gravity.linear = self.base.axes.T @ gravity
        return float(self._pin.computePotentialEnergy(self._model, self._data, self._full(q)))

    def _full(self, q: Vector) -> Vector:
        return self._spread @ q + self._offset

    def _wrench(self, link: str, push: Push) -> Vector:
        """Return a wrench (6,) in the base's axes, with the moment about the origin of the link's frame."""
        back = self.base.axes.T
        arm = back @ (push.point - self.base.origin) - self._data.oMf[self._frames[link]].translation
        force = back @ push.force
        return np.concatenate([force, back @ push.moment + np.cross(arm, force)])


def _plain(description: Description) -> str:
    """Return URDF text without shapes and mimics; continuous joints are revolute, limited by `CONTINUOUS_LIMIT`."""
    robot = ElementTree.fromstring(description.text)
    for item in robot.findall("joint"):
        for mimic in item.findall("mimic"):
            item.remove(mimic)
        joint = description.joints[item.get("name")]
        if joint.moves:
            item.set(
                "type", JointKind.PRISMATIC.value if joint.motion is JointKind.PRISMATIC else JointKind.REVOLUTE.value
            )
            for limit in item.findall("limit"):
                item.remove(limit)
            ends = dict.fromkeys(("upper", "velocity", "effort"), repr(CONTINUOUS_LIMIT))
            ElementTree.SubElement(item, "limit", {"lower": repr(-CONTINUOUS_LIMIT), **ends})
    for link in robot.findall("link"):
        for tag in ("visual", "collision"):
            for part in link.findall(tag):
                link.remove(part)
    return ElementTree.tostring(robot, encoding="unicode")


def _pinocchio() -> Any:
    try:
        pin = import_module("pinocchio")
    except ImportError as error:
        remedy = "remedy: pip install 'gdfe_ros[arm]', or with ROS from apt: apt install ros-jazzy-pinocchio"
        raise ArmError("arm", [f"it needs pinocchio, which is not installed; {remedy}"]) from error
    if not hasattr(pin, "buildModelFromXML"):
        remedy = "remedy: pip uninstall pinocchio; pip install 'gdfe_ros[arm]' (the package is named pin)"
        raise ArmError("arm", [f"the installed package pinocchio is another one; {remedy}"])
    return pin

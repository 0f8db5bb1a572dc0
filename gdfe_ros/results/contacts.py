# SPDX-License-Identifier: Apache-2.0
"""Contact points at the end of a step, and contact forces on sensor patches of the surface."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators import Embedding
from gdfe_ros.constraints import Handle
from gdfe_ros.constraints.obstacle import NAME as SELF
from gdfe_ros.constraints.obstacle import Obstacle, SelfContact
from gdfe_ros.constraints.rigid_body import RigidBody, rigid_pairs
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.solver.contact.touch import Touch

_PLACE, _NORMAL, _PUSH, _SHEAR = ("x", "y", "z"), ("nx", "ny", "nz"), ("fx", "fy", "fz"), ("tx", "ty", "tz")
POINT = np.dtype(
    [(name, "<f4") for name in (*_PLACE, *_NORMAL, "gap", *_PUSH, *_SHEAR)]
    + [(name, "<i4") for name in ("slips", "vertex", "contact", "other")]
)
"""A contact point, with these fields: ``x, y, z`` position [m]; ``nx, ny, nz`` normal of the touched surface; ``gap``
[m]; ``fx, fy, fz`` normal force [N]; ``tx, ty, tz`` friction force [N]; ``slips`` 1 if the point slips; ``vertex`` of
the point; ``contact`` index of the contact's name; ``other`` touched vertex. For a point of a skin, ``vertex`` is the
vertex with the largest weight; for a corner of a rigid body, it is -1. ``other`` is -1 unless the body touches itself.
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class ContactSensor:
    """A part of the body's surface whose contact forces are summed, e.g. a fingertip.

    Attributes:
        name: name of the sensor.
        vertices: vertices of the sensor's faces (k,) int32.
        numbers: indices (p,) int32 of the sensor's points among the contact points of a skin; empty without a skin.
        points: embedding of these points in the cells; None without a skin.

    Example:
        >>> simulation = Simulation(load_scene("my_finger.yaml"))  # with sensors: {tip: {where: {face: x+}}}
        >>> result = simulation.step(command)
        >>> force, moment = np.split(simulation.scene.sensors["tip"].wrench(result), 2)
    """

    name: str
    vertices: NDArray[np.int32]
    numbers: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    points: Embedding | None = None

    def centre(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the mean (3,) [m] of the sensor's vertices and points, for the body's ``positions`` (n, 3) [m]."""
        if self.points is None:
            return positions[self.vertices].mean(axis=0)
        return np.concatenate([positions[self.vertices], self.points.at(positions)]).mean(axis=0)

    def wrench(self, result: StepResult) -> NDArray[np.float64]:
        """Return the contact force [N] and moment [N m] on the sensor (6,), about the sensor's present centre."""
        total, centre = np.zeros(6), self.centre(result.positions)
        for touch in result.contacts.values():
            if not len(touch.vertices):  # no contact, or none with the elastic body
                continue
            mine = np.isin(touch.vertices, self.vertices)
            if len(touch.points):
                mine = np.where(touch.points < 0, mine, np.isin(touch.points, self.numbers))
            forces = touch.forces[mine]
            total[:3] += forces.sum(axis=0)
            total[3:] += np.cross(touch.places[mine] - centre, forces).sum(axis=0)
        return total


def contact_names(handles: Iterable[Handle], self_contact: SelfContact | None = None) -> list[str]:
    """Return the names in `StepResult.contacts` for a scene's handles, in their order.

    First come the contacts of the body with obstacles and rigid bodies, under the names of these items. Then come the
    contacts of rigid bodies' points with obstacles and other rigid bodies, as in `rigid_pairs`. With ``self_contact``,
    the contact of the body with itself comes last.
    """
    pairs = _contact_pairs(handles)
    names = [thing.name if rigid is None else f"{rigid.name} on {thing.name}" for rigid, thing in pairs]
    return names + [SELF] * (self_contact is not None)


def _contact_pairs(handles: Iterable[Handle]) -> list[tuple[RigidBody | None, Obstacle]]:
    """Return both sides of each contact, in the order of `contact_names`, without self-contact; None: the soft body."""
    touched = [handle for handle in handles if isinstance(handle, Obstacle)]
    return [(None, thing) for thing in touched] + list(rigid_pairs(touched))


def contact_points(contacts: Mapping[str, Touch]) -> NDArray[np.void]:
    """Return all contact points (k,) as `POINT`; the field ``contact`` is the index of the contact in ``contacts``."""
    rows = [_points(number, touch) for number, touch in enumerate(contacts.values())]
    return np.concatenate(rows) if rows else np.zeros(0, POINT)


def total_forces(points: Mapping[str, NDArray], handles: Iterable[Handle]) -> dict[str, NDArray[np.float64]]:
    """Return the total contact force (3,) [N] on each obstacle and rigid body, by name.

    Forces by soft bodies and by rigid bodies are counted; `StepResult.reactions` only has forces on soft bodies.

    Args:
        points: contact points (k,) as `POINT`, or a dict from each of its fields to an array (k,).
        handles: the scene's handles.
    """
    pairs, (_, forces) = _contact_pairs(handles), places_and_forces(points)
    totals = {thing.name: np.zeros(3) for _, thing in pairs}
    for number, (rigid, thing) in enumerate(pairs):
        force = forces[points["contact"] == number].sum(axis=0, dtype=np.float64)
        totals[thing.name] -= force
        if rigid is not None:
            totals[rigid.name] += force
    return totals


def places_and_forces(points: Mapping[str, NDArray]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the positions (k, 3) [m] of ``points``, given as in `total_forces`, and the forces (k, 3) [N] on them."""
    places = np.stack([points[axis] for axis in _PLACE], axis=1)
    return places, np.stack([points[push] + points[shear] for push, shear in zip(_PUSH, _SHEAR, strict=True)], axis=1)


def _points(number: int, touch: Touch) -> NDArray[np.void]:
    points = np.zeros(len(touch.presses), POINT)
    pushes = touch.presses[:, None] * touch.normals
    for vectors, names in ((touch.places, _PLACE), (touch.normals, _NORMAL), (pushes, _PUSH), (touch.shears, _SHEAR)):
        for name, column in zip(names, vectors.T, strict=True):
            points[name] = column
    points["gap"], points["slips"], points["contact"] = touch.gaps, touch.slips, number
    points["vertex"] = touch.vertices if len(touch.vertices) else -1
    points["other"] = touch.others if len(touch.others) else -1
    return points

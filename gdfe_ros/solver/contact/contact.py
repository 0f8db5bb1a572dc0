# SPDX-License-Identifier: Apache-2.0
"""Term of the potential for the contact of points with one obstacle or rigid body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.distances import ORIGIN, form_numbers, measure
from gdfe_ros.constraints.obstacle import ContactPoints, Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.contact_surface import TURNED, CarriedPoints, ContactSurface
from gdfe_ros.solver.contact.contact_term import FAINT, ContactTerm
from gdfe_ros.solver.contact.gap import find_close
from gdfe_ros.solver.contact.stencil import NO_FACES, NOTHING_NEAR, Stencils, Surfaces, sum_wrench, take_frames
from gdfe_ros.solver.contact.touch import NOTHING, Touch
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.state import Saved, State
from gdfe_ros.solver.vectors import largest_distance

ENTRY = 1e-3
"""A point counts as outside if its distance from the obstacle, divided by the body's size, exceeds this. A point that
moves from outside into the obstacle within one step gets an entry plane: the tangent plane of the obstacle where the
point entered. Contact pushes the point back across this plane, and not out of the obstacle on another side.
"""
REACH = 0.05
"""Points take part in contact if their distance from the obstacle, divided by the body's size, is below this number.
Distances are computed again after the body has moved by half of this number times its size. If all points are outside
of this distance, they are computed again only after a motion that may bring a point within it.
"""


class Contact(ContactTerm):
    """Contact of points with an obstacle or a rigid body.

    Args:
        name: name of the term.
        touched: the obstacle or rigid body that the points must stay outside of.
        body: the discretised body.
        points: the points that must stay outside.
        friction: Coulomb's coefficient.
        restitution: ratio of the normal speeds of a point after and before an impact.
    """

    OTHERS = 12
    """Count of the numbers of the obstacle's frame: rotation and origin."""

    def __init__(
        self,
        name: str,
        touched: Obstacle,
        body: Body,
        points: CarriedPoints,
        *,
        friction: float,
        restitution: float,
    ) -> None:
        self._touched, self._points, self._radius = touched, points, 0.0
        self.ANCHOR = 3 + points.carriers.shape[1]
        count, vertices = len(points.carriers), points.carriers.ravel()
        if isinstance(touched, RigidBody):
            vertices = np.concatenate([vertices, touched.vertices])
        super().__init__(name, body, count, np.unique(vertices), friction=friction, restitution=restitution)
        self._form = form_numbers(touched.form)
        four = (touched.vertices, touched.signs) if isinstance(touched, RigidBody) else ()
        self.shape = Surfaces.of(touched.form.kind, points.carriers.shape[1], self._form, *four)
        self._scale, self._held_fast = np.zeros(count), np.zeros(count, dtype=bool)
        self._distances, self._normals = np.zeros(count), np.zeros((count, 3))
        self._entered = np.zeros((count, 4))
        self._take_none()
        self._clear, self._began, self._seen = -np.inf, np.zeros((0, 3)), body.rest
        self._pose, self._last = Pose(), None
        self._free["anchor"] = np.full((count, 3), np.nan)

    @property
    def on_body(self) -> bool:
        """Whether the points belong to the elastic body."""
        return isinstance(self._points, ContactSurface)

    @property
    def held_mass(self) -> float:
        """Mass [kg] of a rigid body that the elastic body touches, else 0."""
        return self._touched.mass if self.on_body and isinstance(self._touched, RigidBody) else 0.0

    @property
    def _bounces(self) -> bool:
        """Whether a ball that presses keeps its entry plane: only balls that touch an obstacle do.

        On a rigid body, a contact force that misses the body's centre would turn the body, and the plane with it.
        """
        return self._radius > 0.0 and not isinstance(self._touched, RigidBody)

    @property
    def inside(self) -> bool:
        """Whether any point was inside the obstacle when the distances were last computed."""
        return bool(self._distances.min(initial=0.0) < -FAINT * self._body.size)

    def fit(self, matrix: ConstantMatrix) -> None:
        """Compute the stiffness of each point from the constant matrix' diagonal."""
        self._scale = 1.0 / self._points.compliance(self._body, matrix.assembled.diagonal())

    def leave_out(self, held: Sequence[tuple[str, NDArray[np.int32]]]) -> None:
        """Leave out points that a grip holds in their places: otherwise the forces of grip and contact would add up.

        Args:
            held: pairs of the name of an obstacle or rigid body, and the vertices that a grip holds on it.
        """
        own = [vertices for name, vertices in held if name == self._touched.name]
        carriers = self._points.carriers
        self._held_fast = np.zeros(len(carriers), dtype=bool)
        for vertices in own:
            self._held_fast |= np.isin(carriers, vertices).all(axis=1)

    def set_targets(self, poses: Mapping[str, Pose], last: State) -> None:
        """Set the commanded pose of the obstacle and the state at the end of the last step."""
        self._pose, self._last = poses[self._touched.name], last

    def begin(self, commands: Mapping[str, float], saved: Saved, positions: NDArray[np.float64], ratio: float) -> None:
        """Choose the points near the obstacle. Start from the last step's multipliers, rotated with the obstacle."""
        self._saved, self._entered[...] = saved, 0.0
        self._choose(saved, positions)

    def room(self, positions: NDArray[np.float64]) -> float:
        """Return the distance [m] that vertices may move from ``positions`` (n, 3) [m] before other points are near."""
        room = max(self._clear, 0.5 * REACH * self._body.size) - self._bound_motion(positions)
        return room / (self._points.reach + TURNED * isinstance(self._touched, RigidBody))

    def follow(self, positions: NDArray[np.float64], ahead: float) -> None:
        """Choose the points again at ``positions`` (n, 3) [m]; points that stay chosen keep their forces."""
        press, shear = self._free["press"].copy(), self._free["shear"].copy()
        press[self._chosen], shear[self._chosen] = self.stencils.held[:, 0], self.to_stored_axes(self.stencils.shears)
        if self._bounces:  # this force is what keeps a ball from entering
            self._entered[self._chosen] = np.where(self.stencils.held[:, :1] > 0.0, self.stencils.planes, 0.0)
        self._choose({**self._saved, "press": press, "shear": shear}, positions)

    def look(self, positions: NDArray[np.float64]) -> None:
        """Do `ContactTerm.look` with the present frame of a rigid body."""
        if isinstance(self._touched, RigidBody):
            self._take_frame(positions)
        super().look(positions)

    def lay_out(self, positions: NDArray[np.float64], stencils: Stencils) -> None:
        """Do `ContactTerm.lay_out`."""
        own, chosen, self.shape.frames[0] = self._points.carriers.shape[1], self._chosen, self._others
        stencils.anchors[...], stencils.scale[...] = self._anchors[:, :3], self._scale[chosen]
        stencils.planes[...], stencils.fixed[...], stencils.offsets[...] = self._planes, self._fixed, self._radius
        stencils.ends[:, :own], stencils.pressing[:, :own] = self._points.carriers[chosen], self._points.weights[chosen]
        stencils.rubbing[:, :own], stencils.ends[:, own:] = self._anchors[:, 3:], stencils.ends[:, :1]
        if isinstance(self._touched, RigidBody):
            stencils.ends[:, own : own + 4] = self._touched.vertices
        stencils.areas[...] = self._points.areas[chosen] if len(self.faces[0]) else 0.0

    def to_stored_axes(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return vectors (k, 3) in the obstacle's axes."""
        return vectors @ self._axes

    def keep_places(self, kept: Saved) -> None:
        """Write the anchors of the points that stick.

        Points that slip have no stored anchor: in the next step, their anchors are their positions at the start of that
        step.
        """
        sticks = kept["slips"][self._chosen] == 0.0
        kept["anchor"][self._chosen[sticks]] = self._pack_anchors()[sticks]

    def resume(self, commands: Mapping[str, float], saved: Saved, found: Saved, positions: NDArray[np.float64]) -> None:
        """Prepare the linearisation of a solve: choose the points in contact at its end, with their contact forces."""
        self._led, self._entered[...] = np.zeros((0, 3)), 0.0
        if not found["press"].any():
            self._take_none()
            return
        self._choose({**saved, "press": found["press"], "shear": found["shear"]}, positions)
        self.lead(found, positions)

    def vary(self, commands: Mapping[str, float], saved: Saved, positions: NDArray[np.float64]) -> None:
        """Update the obstacle's frame and the anchors of the chosen points; keep the choice of points."""
        if self.near:
            self._take_frame(positions)
            self._see(saved, positions)
            self._set_anchors(saved, positions)
            self._anchors[:, :3] -= self._led

    def wrench(self, positions: NDArray[np.float64], saved: Saved | None = None) -> NDArray[np.float64]:
        """Return the obstacle's wrench (6,) on the points: force [N], then moment [N m] about the obstacle's origin.

        If a stored state ``saved`` of the term is given, the forces are its mean forces; otherwise they are the
        multipliers.
        """
        if not self.acts:
            return np.zeros(6)
        if saved is None:
            forces = self.stencils.held[:, :1] * self.stencils.axes[:, 0] - self.stencils.shears
        else:
            pushes = saved["push"][self._chosen, None] * self.stencils.normals
            forces = pushes + saved["rub"][self._chosen] @ self._axes.T
        return sum_wrench(positions, self.stencils, self._points.carriers.shape[1], self._origin, forces)

    def find_led_motion(self, positions: NDArray[np.float64], before: State) -> NDArray[np.float64]:
        """Return the obstacle's displacement (k, 3) [m] at the chosen points since the state ``before``.

        It is zero for a touched rigid body, because the body moves by its own vertices and not by a commanded pose.
        """
        if isinstance(self._touched, RigidBody):
            return np.zeros((self.count, 3))
        pose = before.poses[self._touched.name]
        if pose == self._pose:
            return np.zeros((self.count, 3))
        places, frame = self._points.at(positions)[self._chosen], self._frame(before.positions, pose)
        return places - frame[ORIGIN:] - self._in_frame(places) @ frame[:ORIGIN].reshape(3, 3).T

    def touch(
        self, saved: Saved, positions: NDArray[np.float64], poses: Mapping[str, Pose], origin: NDArray[np.float64]
    ) -> Touch:
        """Return the contacts and forces in the stored state ``saved``.

        ``positions`` (n, 3) [m] and ``poses`` belong to the same state, and are relative to ``origin`` (3,) [m].
        """
        on = np.flatnonzero(saved["push"])
        if not len(on):
            return NOTHING
        frame = self._frame(positions, poses[self._touched.name])
        places, axes = self._points.at(positions)[on], frame[:ORIGIN].reshape(3, 3)
        gaps, normals = measure(places, frame, self._form, self._touched.form.kind)
        length = np.linalg.norm(normals, axis=1, keepdims=True)  # below 1 at a mesh's edges
        return Touch(
            vertices=self._points.vertices[on] if self.on_body else np.zeros(0, dtype=np.int32),
            points=self._points.points[on] if self.on_body else np.zeros(0, dtype=np.int32),
            places=places - self._radius * normals + origin,
            normals=normals / np.maximum(length, np.finfo(float).tiny),
            gaps=gaps - self._radius,
            presses=saved["push"][on],
            shears=saved["rub"][on] @ axes.T,
            slips=saved["slips"][on] > 0.0,
        )

    @property
    def _obstacle(self) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
        """Frame (12,), form and kind of the obstacle, for the kernels of `gap`."""
        return self.shape.frames[0], self._form, self._touched.form.kind

    @property
    def _origin(self) -> NDArray[np.float64]:
        return self.shape.frames[0, ORIGIN:]

    @property
    def _axes(self) -> NDArray[np.float64]:
        return self.shape.frames[0, :ORIGIN].reshape(3, 3)

    def _frame(self, positions: NDArray[np.float64], pose: Pose) -> NDArray[np.float64]:
        """Return rotation and origin (12,) [m] of the touched obstacle or rigid body."""
        if isinstance(self._touched, RigidBody):
            found = np.empty((1, 12))
            take_frames(positions, self.shape, found)
            return found[0]
        origin, axes = self._touched.frame(pose)
        return np.concatenate([axes.ravel(), origin])

    def _take_frame(self, positions: NDArray[np.float64]) -> None:
        """Write the obstacle's present frame to the numbers of the term."""
        self.shape.frames[0] = self._others[...] = self._frame(positions, self._pose)

    def _bound_motion(self, positions: NDArray[np.float64]) -> float:
        """Return an upper bound of the displacement [m] of any point since the distances were computed."""
        if not isinstance(self._touched, RigidBody):
            return self._points.reach * largest_distance(positions, self._seen)
        if not self.on_body:
            return TURNED * largest_distance(positions, self._seen)
        four, count = self._touched.vertices, self._body.count
        own = self._points.reach * largest_distance(positions[:count], self._seen[:count])
        return own + TURNED * largest_distance(positions[four], self._seen[four])

    def _take_none(self) -> None:
        self._chosen = self._around = np.zeros(0, dtype=np.int64)
        self.stencils, self.faces = NOTHING_NEAR

    def _in_frame(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        return (places - self._origin) @ self._axes

    def _see(self, saved: Saved, positions: NDArray[np.float64]) -> tuple[NDArray, NDArray, NDArray]:
        """Measure all points at ``positions`` (n, 3) [m]; return their places and entry planes, and the near points.

        If there is no last step, the step begins at ``positions``.
        """
        before = self._others
        if self._last is not None:
            before = self._frame(self._last.positions, self._last.poses[self._touched.name])
        last, size = positions if self._last is None else self._last.positions, self._body.size
        given = self._points.carriers, self._points.weights, self._others, before, self._form, self._touched.form.kind
        limits = self._radius, ENTRY * size, REACH * size
        found = find_close(positions, last, *given, *limits, self._entered, saved["press"], self._held_fast)
        places, self._distances, self._normals, self._began, planes, near = found
        return places, planes, near

    def _choose(self, saved: Saved, positions: NDArray[np.float64]) -> None:
        """Choose the points that are near at ``positions`` (n, 3) [m], touched in the last step, or enter now."""
        self._take_frame(positions)
        places, planes, near = self._see(saved, positions)
        self._seen, self._clear = positions.copy(), self._distances.min(initial=np.inf) - REACH * self._body.size
        if not len(near):
            self._take_none()
            return
        self._chosen = chosen = self._first_to_touch(near, places)
        self._planes, self._fixed = planes[chosen], self._bounces & planes[chosen].any(axis=1)
        self._fix_planes(places[chosen], positions)
        self._set_anchors(saved, positions)
        faces = self.on_body and self._touched.points is ContactPoints.FACES
        if not faces:
            self.faces = NO_FACES
        elif not np.array_equal(chosen, self._around):
            self.faces, self._around = self._points.about(chosen), chosen
        self.lay_out(positions, self.hold_forces(saved["press"][chosen], saved["shear"][chosen] @ self._axes.T))

    def _fix_planes(self, places: NDArray[np.float64], positions: NDArray[np.float64]) -> None:
        """Give some chosen points at ``places`` (k, 3) [m] a plane that replaces the whole surface of the obstacle."""

    def _first_to_touch(self, near: NDArray[np.int64], places: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the indices, out of ``near`` (k,), of the points that may touch first; ``places`` has all points."""
        return near

    def _set_anchors(self, saved: Saved, positions: NDArray[np.float64]) -> None:
        """Set the anchors of the chosen points at the start of a step, in the obstacle's frame."""
        anchors = saved["anchor"][self._chosen]
        self._anchors[:, :3] = np.where(np.isnan(anchors), self._began[self._chosen], anchors)
        self._anchors[:, 3:] = self._points.weights[self._chosen]

    def _pack_anchors(self) -> NDArray[np.float64]:
        """Return the anchors (k, 3) [m] that the state stores for the chosen points."""
        return self._anchors[:, :3]

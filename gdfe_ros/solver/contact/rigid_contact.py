# SPDX-License-Identifier: Apache-2.0
"""Terms of the potential for the contact of a rigid body with an obstacle or another rigid body."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from gdfe_ros.constraints.distances import ORIGIN, measure
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.contact import Contact
from gdfe_ros.solver.contact.contact_surface import CarriedPoints
from gdfe_ros.solver.state import Saved

AT_EDGE, BESIDE, SMOOTH = 1e-3, 1e-5, 0.1
"""A point lies at an edge if two conditions hold. Its distance, divided by the body's size, is below the first number.
Normals at points beside it, at the second number times the body's size, differ by more than the third number.
"""
FLAT, FEW = 9, 4
"""Points whose normals agree in the first number of decimals count as points near one flat face. Of up to the second
number of such points, all are used.
"""


class RigidContact(Contact):
    """Contact of a rigid body's points with an obstacle or another rigid body.

    The larger of the two friction coefficients acts. Two rigid bodies have two such terms, unless one of the bodies is
    a ball: the points of each body are tested against the shape of the other body. The points are the corners of the
    body. For contact of a body that is not round with another rigid body, they are distributed over its surface.

    Args:
        rigid: the body whose points touch.
        touched: the obstacle or rigid body that the points must stay outside of.
        body: the discretised body.
    """

    def __init__(self, rigid: RigidBody, touched: Obstacle, body: Body) -> None:
        over = isinstance(touched, RigidBody) and not rigid.form.rounding
        points = CarriedPoints.of(rigid, rigid.form.skin if over else rigid.form.corners)
        friction, restitution = max(rigid.friction, touched.friction), max(rigid.restitution, touched.restitution)
        name = f"{rigid.name} on {touched.name}"
        super().__init__(name, touched, body, points, friction=friction, restitution=restitution)
        self._rigid = rigid

    def _fix_planes(self, places: NDArray[np.float64], positions: NDArray[np.float64]) -> None:
        """Give the points at edges of the touched obstacle or rigid body a fixed plane.

        Otherwise rounding would decide through which face a point at an edge is pushed out. The plane has the normal of
        the obstacle towards the centre of the points' own body.
        """
        near = np.flatnonzero(np.abs(self._distances[self._chosen]) < AT_EDGE * self._body.size)
        if self._radius > 0.0 or not len(near):
            return
        shift = BESIDE * self._body.size
        around = places[near] + shift * np.concatenate([np.eye(3), -np.eye(3)])[:, None]
        beside = measure(around.reshape(-1, 3), *self._obstacle)[1].reshape(around.shape)
        edge = near[np.linalg.norm(np.ptp(beside, axis=0), axis=1) > SMOOTH]
        if not len(edge):
            return
        facing = measure(positions[self._rigid.vertices].mean(axis=0)[None], *self._obstacle)[1][0]
        if not facing.any():
            return
        chosen, normal = self._chosen[edge], facing @ self._axes / np.linalg.norm(facing)
        surface = places[edge] - self._distances[chosen, None] * self._normals[chosen]
        self._planes[edge, :3], self._planes[edge, 3] = normal, self._in_frame(surface) @ normal
        self._fixed[edge] = True

    def _first_to_touch(self, near: NDArray[np.int64], places: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the points near flat faces that are vertices of the lower convex hull of gaps, and all other points.

        Above a flat face, a rigid motion changes gaps by a linear function of the place. The least gap is then at a
        vertex of the hull. Forces on the other points can be replaced by forces on the vertices with the same sum and
        moment.
        """
        if len(near) <= FEW:
            return near
        _, group = np.unique(np.round(self._normals[near], FLAT) + 0.0, axis=0, return_inverse=True)
        kept = [near[group.ravel() == each] for each in range(group.max(initial=-1) + 1)]
        kept = [own if len(own) <= FEW else own[self._lowest(places[own], own)] for own in kept]
        return np.sort(np.concatenate([near[:0], *kept]))

    def _lowest(self, places: NDArray[np.float64], own: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the vertices of the lower hull of ``places`` (k, 3) with one normal; all if they lie on a line."""
        normal = self._normals[own[0]]
        across = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
        plane = (places - places.mean(axis=0)) @ np.stack([across, np.cross(normal, across)], axis=1)
        apex = self._distances[own].max() + np.ptp(plane)
        hull = np.vstack([np.column_stack([plane, self._distances[own]]), [0.0, 0.0, apex]])
        try:
            return np.setdiff1d(ConvexHull(hull).vertices, len(own))
        except QhullError:
            return np.arange(len(own))


class RoundContact(RigidContact):
    """Contact of a rigid body that is a ball or a row of balls; its points are the centres of the balls.

    A rolling ball touches with another material point in each step. For a sticking point, the state therefore stores
    the slip of the touching material point instead of an anchor position. Thanks to this slip, a ball at rest does not
    creep.

    Args:
        rigid: the round body.
        touched: the obstacle or rigid body that it must stay outside of.
        body: the discretised body.
    """

    def __init__(self, rigid: RigidBody, touched: Obstacle, body: Body) -> None:
        super().__init__(rigid, touched, body)
        self._radius = rigid.form.rounding

    def _set_anchors(self, saved: Saved, positions: NDArray[np.float64]) -> None:
        """Set the material points that touched when the step began, and their anchors: places minus stored slips."""
        state, chosen = self._last, self._chosen
        before = positions if state is None else state.positions
        pose = self._pose if state is None else state.poses[self._touched.name]
        frame, centres = self._frame(before, pose), np.ascontiguousarray(self._points.at(before)[chosen])
        normals = measure(centres, frame, self._form, self._touched.form.kind)[1]
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
        arms, slid = -self._radius * normals, saved["anchor"][chosen]
        own = arms @ self._rigid.find_frame(before)[1] @ self._rigid.signs.T
        self._anchors[:, 3:] = self._points.weights[chosen] + own
        began = (centres + arms - frame[ORIGIN:]) @ frame[:ORIGIN].reshape(3, 3)
        self._anchors[:, :3] = began - np.where(np.isnan(slid), 0.0, slid)

    def _pack_anchors(self) -> NDArray[np.float64]:
        """Return the slips (k, 3) [m] of the material points along the surface, in the obstacle's frame."""
        return self.to_stored_axes(self.stencils.slips)

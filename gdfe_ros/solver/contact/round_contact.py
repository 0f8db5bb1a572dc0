# SPDX-License-Identifier: Apache-2.0
"""Term of the potential for the contact of a ball, or of a row of balls, with an obstacle or another rigid body."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact import gap
from gdfe_ros.solver.contact.gap import ANCHOR, NORMAL, OFFSET, WEIGHTS
from gdfe_ros.solver.contact.rigid_contact import RigidContact
from gdfe_ros.solver.contact.surface import Corners
from gdfe_ros.solver.state import Saved

MATERIAL = WEIGHTS + 4
"""Place in a point's row of the weights (4,) of the material point on which friction acts."""


class RoundContact(RigidContact):
    """Contact of a rigid body that is a ball or a row of balls; its points are the centres of the balls.

    For a sticking point, the state stores the slip of the material point in contact, instead of an anchor position. The
    reason is that a rolling ball touches with another material point in each step. A ball at rest thus does not creep.

    Args:
        rigid: the round body.
        touched: the obstacle or rigid body that it must stay outside of.
        body: the discretised body.
    """

    def __init__(self, rigid: RigidBody, touched: Obstacle, body: Body) -> None:
        super().__init__(rigid, touched, body, points=Corners.of(rigid))
        self._rigid, self._radius, self.integers[gap.RUB] = rigid, rigid.form.rounding, MATERIAL

    def _measure(self, places: NDArray[np.float64]) -> None:
        super()._measure(places)
        self._distances -= self._radius

    def _choose(self, saved: Saved, positions: NDArray[np.float64]) -> None:
        """Choose the points as `Contact` does, and the material points that touched when the step began."""
        super()._choose(saved, positions)
        self._rows()[:, ANCHOR : ANCHOR + 3] = self._anchors(saved, positions)

    def _anchors(self, saved: Saved, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Set the material points. Return their anchors (k, 3) [m]: positions at the step's start minus stored slip."""
        state, chosen = self._last, self._chosen
        before = positions if state is None else state.positions
        pose = self._pose if state is None else state.poses[self._touched.name]
        origin, axes = self._frame(before, pose)
        centres = np.ascontiguousarray(self._points.at(before)[chosen])
        now = self._origin.copy(), self._axes.copy()
        away, normals = np.empty(len(centres)), np.empty((len(centres), 3))
        self._origin[...], self._axes[...] = origin, axes
        gap.distances(centres, self.reals, self._touched.form.kind, away, normals)
        self._origin[...], self._axes[...] = now
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
        arms = -self._radius * normals
        own = arms @ self._rigid.found(before)[1] @ self._rigid.signs.T
        self._rows()[:, MATERIAL : MATERIAL + 4] = self._points.weights[chosen] + own
        slid = saved["anchor"][chosen]
        return (centres + arms - origin) @ axes - np.where(np.isnan(slid), 0.0, slid)

    def _kept(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the slips (k, 3) [m] of the material points along the surface, in the obstacle's frame."""
        slid = self._in_frame(places) - self._rows()[:, ANCHOR : ANCHOR + 3]
        normals = self._rows()[:, NORMAL : NORMAL + 3] @ self._axes
        return slid - np.einsum("ki,ki->k", slid, normals)[:, None] * normals

    def _rubbing(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        rows = self._rows()
        return rows[:, MATERIAL : MATERIAL + 4] @ positions[self._rigid.vertices]

    def _correct(self, positions: NDArray[np.float64]) -> float:
        """Set the offsets to the radius; return their error 0."""
        self._rows()[:, OFFSET] = self._radius
        return 0.0

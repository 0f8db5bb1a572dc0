# SPDX-License-Identifier: Apache-2.0
"""Term of the potential for the contact of a ball, or of a row of balls, with an obstacle or another rigid body."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints.distances import measure
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.rigid_contact import RigidContact
from gdfe_ros.solver.state import Saved


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
        super().__init__(rigid, touched, body)
        self._radius = rigid.form.rounding

    def _set_anchors(self, saved: Saved, positions: NDArray[np.float64]) -> None:
        """Set the material points that touched when the step began, and their places then minus the stored slip."""
        state, chosen = self._last, self._chosen
        before = positions if state is None else state.positions
        pose = self._pose if state is None else state.poses[self._touched.name]
        origin, axes = self._frame(before, pose)
        centres = np.ascontiguousarray(self._points.at(before)[chosen])
        normals = measure(centres, np.append(axes, origin), self._form, self._touched.form.kind)[1]
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
        arms, slid = -self._radius * normals, saved["anchor"][chosen]
        own = arms @ self._rigid.found(before)[1] @ self._rigid.signs.T
        self._anchors[:, 3:] = self._points.weights[chosen] + own
        self._anchors[:, :3] = (centres + arms - origin) @ axes - np.where(np.isnan(slid), 0.0, slid)

    def _kept(self) -> NDArray[np.float64]:
        """Return the slips (k, 3) [m] of the material points along the surface, in the obstacle's frame."""
        return self.stored(self.stencils.slips)

# SPDX-License-Identifier: Apache-2.0
"""Where handles are: as commanded, and moved on by what is free about them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.errors import CommandError
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.matrix.unknowns import Frame, handle_centres

Vectors = NDArray[np.float64]


LEAST_TURN = 1e-6
"""Share of what tells a handle's rotation at rest that is left where it can still be told."""


class HandleMotions:
    """The kinematics of a body's handles.

    A handle with free axes is placed at its commanded pose without the components of the rotation vector about free
    axes; from there it is moved by a translation along its free axes and a rotation vector about them, which are found.

    Args:
        body: the discretised body.

    Attributes:
        turn: whether any handle turns freely.
    """

    def __init__(self, body: Body) -> None:
        self._body = body
        self._loose = [handle for handle in body.handles if handle.free or handle.turning]
        self._row = {handle.name: p for p, handle in enumerate(self._loose)}
        self._centres = {handle.name: handle.centre(body.rest) for handle in body.handles}
        self.turn = bool((body.unknowns.turn_row >= 0).any())

    def base(self, poses: Mapping[str, Pose], last: Mapping[str, Pose], base: Vectors) -> Vectors:
        """Return (n, 3) [m] with the handles' vertices at commanded ``poses``; ``base`` has them at the ``last``."""
        moved = [handle for handle in self._body.handles if poses[handle.name] != last[handle.name]]
        if not moved:
            return base
        placed = base.copy()
        for handle in moved:
            pose = self._commanded(handle, poses[handle.name])
            placed[handle.vertices] = pose.apply(self._body.rest[handle.vertices], self._centres[handle.name])
        return placed

    def frame(self, base: Vectors) -> Frame:
        """Return the frame for kernels of handles at ``base`` (n, 3) [m]."""
        return Frame(base, handle_centres(base, self._body.unknowns))

    def placed(self, base: Vectors, slides: Vectors, turns: Vectors) -> Vectors:
        """Return ``base`` (n, 3) [m] with the handles that turn moved on by their free motions (p, 3)."""
        moved = base.copy()
        for p, handle in enumerate(self._loose):
            if handle.turning:
                centre = base[handle.vertices].mean(axis=0)
                arms = Rotation.from_rotvec(turns[p]).apply(base[handle.vertices] - centre)
                moved[handle.vertices] = centre + slides[p] + arms
        return moved

    def put(self, slides: Vectors, turns: Vectors, places: Mapping[str, Pose]) -> tuple[Vectors, Vectors]:
        """Return free motions (p, 3) with those of handles that move freely in all ways as their poses say."""
        slides, turns = slides.copy(), turns.copy()
        for name, pose in places.items():
            slides[self._row[name]], turns[self._row[name]] = pose.translation, pose.rotation
        return slides, self.within_a_turn(turns)

    def turning_vertices(self) -> NDArray[np.bool_]:
        """Tell which of the prescribed vertices (b,) belong to handles that turn freely."""
        turning = [np.full(len(handle.vertices), bool(handle.turning)) for handle in self._body.handles]
        return np.concatenate([np.zeros(0, dtype=bool), *turning])

    def rotations(self, poses: Mapping[str, Pose], turns: Vectors) -> Vectors:
        """Return the rotation matrices (p, 3, 3) of the handles with a free axis."""
        found = [Rotation.from_rotvec(self.pose(handle.name, poses, turns).rotation) for handle in self._loose]
        return np.array([rotation.as_matrix() for rotation in found]).reshape(-1, 3, 3)

    def pose(self, name: str, poses: Mapping[str, Pose], turns: Vectors) -> Pose:
        """Return the pose of a handle: as commanded, turned on by its free rotation; without what it slid."""
        pose = poses[name]
        if name not in self._row or not self._loose[self._row[name]].turning:
            return pose
        handle, turn = self._loose[self._row[name]], turns[self._row[name]]
        commanded = self._commanded(handle, pose)
        if not any(commanded.rotation):
            return Pose(pose.translation, tuple(turn))
        together = Rotation.from_rotvec(turn) * Rotation.from_rotvec(commanded.rotation)
        return Pose(pose.translation, tuple(together.as_rotvec()))

    def within_a_turn(self, turns: Vectors) -> Vectors:
        """Replace rotation vectors of ball joints beyond half a turn by those of the same rotation within it."""
        for p, handle in enumerate(self._loose):
            angle = float(np.linalg.norm(turns[p])) if len(handle.turning) == 3 else 0.0
            if angle > np.pi:
                turns[p] *= 1.0 - 2.0 * np.pi / angle
        return turns

    def fit(self, positions: Vectors, base: Vectors) -> tuple[Vectors, Vectors]:
        """Return the free translations and rotations (p, 3) that bring handles at ``base`` nearest to ``positions``.

        Raises:
            CommandError: a handle that turns freely is so flat or small there that its rotation cannot be told.
        """
        slides, turns = np.zeros((len(self._loose), 3)), np.zeros((len(self._loose), 3))
        for p, handle in enumerate(self._loose):
            here, there = base[handle.vertices], positions[handle.vertices]
            # A handle that only slides keeps the offset of its first vertex: its mean would round.
            shift = there[0] - here[0]
            if handle.turning:
                shift = there.mean(axis=0) - here.mean(axis=0)
                arms, found = here - here.mean(axis=0), there - there.mean(axis=0)
                _require_a_turn(handle, arms, found)
                axes = list(handle.turning)
                turns[p, axes] = Rotation.align_vectors(found, arms)[0].as_rotvec()[axes]
            slides[p, list(handle.free)] = shift[list(handle.free)]
        return slides, turns

    def _commanded(self, handle: Handle, pose: Pose) -> Pose:
        if not handle.turning:
            return pose
        rotation = np.array(pose.rotation)
        rotation[list(handle.turning)] = 0.0
        return Pose(pose.translation, tuple(rotation))


def _require_a_turn(handle: Handle, arms: Vectors, found: Vectors) -> None:
    """Refuse vertices ``found`` (k, 3) [m] about their mean that do not tell how ``arms`` were turned.

    The sum of the two least singular values of their covariance tells: it vanishes where either lies on a line.
    """
    own, given = (np.linalg.svd(each.T @ arms, compute_uv=False)[1:].sum() for each in (arms, found))
    if given < LEAST_TURN * own:
        raise CommandError(
            f"handle {handle.name!r} turns freely, and its vertices at the given positions lie in one point or on a "
            "line: its rotation cannot be told; remedy: give positions at which it has the shape that it has at rest"
        )

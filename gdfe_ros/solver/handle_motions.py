# SPDX-License-Identifier: Apache-2.0
"""Kinematics of handles: their commanded motion, plus the free translations and rotations that a solve finds."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.errors import CommandError
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.matrix.unknowns import HandlePositions, handle_centres
from gdfe_ros.solver.vectors import Array

LEAST_TURN = 1e-6
"""A handle's vertices determine its rotation if their extent, divided by the undeformed extent, is at least this."""


class HandleMotions:
    """Kinematics of a body's handles.

    A handle with free axes is first placed at its commanded pose; components of the commanded rotation vector about
    free axes are ignored. Then a translation along the free axes and a rotation vector about them are added. Both are
    unknowns of the solve.

    Args:
        body: the discretised body.

    Attributes:
        turn: whether any handle rotates freely.
    """

    APART = 0.05
    """Handles count as moving together, nearly as one rigid body, if their rotations [rad], and their motions divided
    by the body's size, differ by at most this.
    """

    def __init__(self, body: Body) -> None:
        self._body = body
        self._loose = [piece for handle in body.handles for piece in handle.pieces if piece.loose]
        self._row = {handle.name: p for p, handle in enumerate(self._loose)}
        self._centres = {handle.name: handle.centre(body.rest) for handle in body.handles}
        self.turn = bool((body.unknowns.turn_row >= 0).any())
        holding = {handle.name: self._centres[handle.name] for handle in body.handles if len(handle.vertices)}
        self._bound = {} if self._loose or any(handle.slide is not None for handle in body.handles) else holding

    def base(self, poses: Mapping[str, Pose], last: Mapping[str, Pose], base: Array) -> Array:
        """Return ``base`` (n, 3) [m] with the handles moved from the poses ``last`` to ``poses``."""
        moved = [handle for handle in self._body.handles if poses[handle.name] != last[handle.name]]
        if not moved:
            return base
        placed = base.copy()
        for handle in moved:
            if not len(handle.vertices):  # an obstacle
                continue
            pose = self._drop_free_turns(handle, poses[handle.name])
            placed[handle.vertices] = pose.apply(self._body.rest[handle.vertices], self._centres[handle.name])
        return placed

    def centres_together(self, poses: Mapping[str, Pose], targets: Mapping[str, Pose]) -> dict[str, Array]:
        """Return the rest centres (3,) [m] of all handles by name if they move together, nearly as one rigid body.

        The dict is empty if they do not move together, or if a handle or vertices on rollers can move freely. Rotations
        that differ by whole turns are different.
        """
        pairs = [(poses[name], targets[name]) for name in self._bound]
        # Plain floats are faster than numpy, and every step calls this method.
        turns = [[b - a for a, b in zip(old.rotation, new.rotation, strict=True)] for old, new in pairs]
        if not (turns and any(turns[0]) and all(math.dist(turn, turns[0]) <= self.APART for turn in turns)):
            return {}
        rotations = np.array([new.turn_from(old) for old, new in pairs])
        beside = find_deviation(poses, targets, self._bound)
        apart = max(np.ptp(rotations, axis=0).max(), np.abs(beside).max() / self._body.size)
        return self._bound if apart <= self.APART else {}

    def frame(self, base: Array) -> HandlePositions:
        """Return the commanded positions ``base`` (n, 3) [m] and the handles' centres there, for the kernels."""
        return HandlePositions(base, handle_centres(base, self._body.unknowns))

    def apply_free_motion(self, base: Array, slides: Array, turns: Array) -> Array:
        """Return ``base`` (n, 3) [m] with the motions ``slides`` and ``turns`` (p, 3) of handles that rotate freely."""
        moved = base.copy()
        for p, handle in enumerate(self._loose):
            if handle.turning:
                centre = base[handle.vertices].mean(axis=0)
                arms = Rotation.from_rotvec(turns[p]).apply(base[handle.vertices] - centre)
                moved[handle.vertices] = centre + slides[p] + arms
        return moved

    def put(self, slides: Array, turns: Array, places: Mapping[str, Pose]) -> tuple[Array, Array]:
        """Return copies of ``slides`` [m] and ``turns`` [rad] (p, 3) with the free motions of handles in ``places``."""
        slides, turns = slides.copy(), turns.copy()
        for name, pose in places.items():
            slides[self._row[name]], turns[self._row[name]] = pose.translation, pose.rotation
        return slides, self.within_a_turn(turns)

    def turning_vertices(self) -> NDArray[np.bool_]:
        """Return a mask (b,) of the prescribed vertices that belong to freely rotating handles."""
        handles = (handle for handle in self._body.handles if handle.slide is None)
        turning = [np.full(len(handle.vertices), bool(handle.turning)) for handle in handles]
        return np.concatenate([np.zeros(0, dtype=bool), *turning])

    def pose(self, name: str, poses: Mapping[str, Pose], turns: Array) -> Pose:
        """Return the pose of a handle: the commanded pose and its free rotation, without its free translation."""
        pose = poses[name]
        if name not in self._row or not self._loose[self._row[name]].turning:
            return pose
        handle, turn = self._loose[self._row[name]], turns[self._row[name]]
        commanded = self._drop_free_turns(handle, pose)
        if not any(commanded.rotation):
            return Pose(pose.translation, tuple(turn))
        together = Rotation.from_rotvec(turn) * Rotation.from_rotvec(commanded.rotation)
        return Pose(pose.translation, tuple(together.as_rotvec()))

    def within_a_turn(self, turns: Array) -> Array:
        """Replace rotation vectors of ball joints beyond 180 degrees by equivalent ones below 180 degrees, in place."""
        for p, handle in enumerate(self._loose):
            angle = float(np.linalg.norm(turns[p])) if len(handle.turning) == 3 else 0.0
            if angle > np.pi:
                turns[p] *= 1.0 - 2.0 * np.pi / angle
        return turns

    def fit(self, positions: Array, base: Array) -> tuple[Array, Array]:
        """Return the free translations and rotations (p, 3) that bring handles at ``base`` closest to ``positions``.

        Raises:
            CommandError: the ``positions`` of a freely rotating handle do not determine its rotation, because they
                are nearly in one point or on a line.
        """
        slides, turns = np.zeros((len(self._loose), 3)), np.zeros((len(self._loose), 3))
        for p, handle in enumerate(self._loose):
            here, there = base[handle.vertices], positions[handle.vertices]
            # For a handle that only translates, the first vertex gives the exact offset; the mean would add rounding.
            shift = there[0] - here[0]
            if handle.turning:
                shift = there.mean(axis=0) - here.mean(axis=0)
                arms, found = here - here.mean(axis=0), there - there.mean(axis=0)
                _require_a_turn(handle, arms, found)
                axes = list(handle.turning)
                turns[p, axes] = Rotation.align_vectors(found, arms)[0].as_rotvec()[axes]
            slides[p, list(handle.free)] = shift[list(handle.free)]
        return slides, turns

    def _drop_free_turns(self, handle: Handle, pose: Pose) -> Pose:
        if not handle.turning:
            return pose
        rotation = np.array(pose.rotation)
        rotation[list(handle.turning)] = 0.0
        return Pose(pose.translation, tuple(rotation))


def find_deviation(began: Mapping[str, Pose], poses: Mapping[str, Pose], centres: Mapping[str, Array]) -> Array:
    """Return the deviation (k, 3) [m] of handles at ``poses`` from a joint rotation about the mean of ``centres``."""
    start, here = (np.array([centres[name] + each[name].translation for name in centres]) for each in (began, poses))
    arms = start - start.mean(axis=0)
    turned = np.array([poses[name].turn_from(began[name]) @ arm for name, arm in zip(centres, arms, strict=True)])
    return here - here.mean(axis=0) - turned


def _require_a_turn(handle: Handle, arms: Array, found: Array) -> None:
    """Raise CommandError if the rotation from ``arms`` (k, 3) [m] to ``found`` (k, 3) [m] is not determined.

    Both sets of vertices are relative to their means. The measured extent is the sum of the two smallest singular
    values of their covariance. It is zero if either set is on a line.
    """
    own, given = (np.linalg.svd(each.T @ arms, compute_uv=False)[1:].sum() for each in (arms, found))
    if given < LEAST_TURN * own:
        raise CommandError(
            f"handle {handle.name!r} turns freely, and its vertices at the given positions lie in one point or on a "
            "line: its rotation is undetermined; remedy: give positions at which it has its undeformed shape"
        )

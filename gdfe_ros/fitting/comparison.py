# SPDX-License-Identifier: Apache-2.0
"""Residuals between simulated and measured values: time shift, frame, interpolation, weights."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.recording import POSITIONS, QuantityKind, Recording
from gdfe_ros.fitting.trajectory import Trajectory

Own = NDArray[np.float64]
"""Unknowns (u,) of one recording, as far as they are fitted: time shift [s], rotation vector [rad], translation [m]."""


def predict_series(
    recording: Recording, trajectory: Trajectory, own: Own, *, horizon: float = np.inf
) -> list[NDArray[np.float64]]:
    """Return simulated values at the measured times, (m, c) for each series; NaN beyond the horizon.

    Args:
        recording: recording with the measured series.
        trajectory: trajectory of the simulation.
        own: unknowns of the recording.
        horizon: simulation time [s] after which nothing is compared.
    """
    shift, pose = split(recording, own)
    found = []
    for series, outputs in zip(recording.series, trajectory.outputs, strict=True):
        moments = series.times - shift
        values = _at(trajectory.times, outputs, moments)
        values[moments > min(horizon, trajectory.times[-1] + 1e-9)] = np.nan
        if pose is not None and series.observable.kind in POSITIONS:
            rotation, translation = pose
            points = rotation.apply(values.reshape(-1, 3)) + translation
            values = points.reshape(values.shape)
        found.append(values if series.along is None else values @ series.along.T)
    return found


def residuals(
    recording: Recording,
    trajectory: Trajectory,
    own: Own,
    sigmas: Sequence[float],
    *,
    quads: NDArray[np.int32],
    horizon: float = np.inf,
) -> list[NDArray[np.float64]]:
    """Return (simulated - measured) / sigma of each series, (m, c) or (m, p); NaN for values that are not compared.

    ``quads`` (f, 4) are the faces of the body's surface, with normals that point outwards.
    """
    found = []
    for series, values, sigma in zip(
        recording.series, predict_series(recording, trajectory, own, horizon=horizon), sigmas, strict=True
    ):
        if series.observable.kind is QuantityKind.SURFACE:
            found.append(surface_distances(values, series.values, quads) / sigma)
        else:
            found.append((values - series.values) / sigma)
    return found


def split(recording: Recording, own: Own) -> tuple[float, tuple[Rotation, NDArray[np.float64]] | None]:
    """Return the time shift [s], and rotation and translation [m] of the frame, or None if no frame is fitted."""
    rest = list(own)
    shift = rest.pop(0) if recording.shift_between is not None else recording.shift
    if not recording.frame:
        return shift, None
    turn = rest[:3] if recording.frame == 6 else (0.0, 0.0, 0.0)
    return shift, (Rotation.from_rotvec(turn), np.array(rest[-3:]))


def first_own(recording: Recording, trajectory: Trajectory) -> Own:
    """Return initial values of a recording's unknowns: a time shift within its bounds, and the best frame.

    The frame is the rigid motion that minimises the squared distances between simulated and measured points (Kabsch
    1976).
    """
    own = []
    if recording.shift_between is not None:
        own.append(float(np.clip(recording.shift, *recording.shift_between)))
    if not recording.frame:
        return np.array(own)
    start = np.zeros(recording.unknowns)
    start[: len(own)] = own
    ours, theirs = [], []
    for series, values in zip(recording.series, predict_series(recording, trajectory, start), strict=True):
        if series.observable.kind in POSITIONS and series.values.ndim == 2:
            points, given = values.reshape(-1, 3), series.values.reshape(-1, 3)
            sound = np.isfinite(points).all(axis=1) & np.isfinite(given).all(axis=1)
            ours.append(points[sound])
            theirs.append(given[sound])
    if not ours:
        raise GdfeError(
            f"recording {recording.name}: `frame` needs positions of known points to begin with, and there is only a "
            "cloud on the surface; remedy: compare a probe as well, or state the cloud in the scene's frame"
        )
    before, after = np.concatenate(ours), np.concatenate(theirs)
    turn = Rotation.identity()
    if recording.frame == 6:
        turn, _ = Rotation.align_vectors(after - after.mean(axis=0), before - before.mean(axis=0))
        own += list(turn.as_rotvec())
    return np.array([*own, *(after.mean(axis=0) - turn.apply(before.mean(axis=0)))])


def surface_distances(
    positions: NDArray[np.float64], points: NDArray[np.float64], quads: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Return the distances (m, p) [m] of ``points`` (m, p, 3) [m] from a surface at m times.

    ``positions`` (m, 3 n) [m] are those of the surface's n vertices. For each point, the face of ``quads`` (f, 4) with
    the closest midpoint is chosen. The distance is that of the point from the plane of this face, positive inside the
    body.
    """
    from scipy.spatial import cKDTree

    found = np.full(points.shape[:2], np.nan)
    for row, (own, cloud) in enumerate(zip(positions, points, strict=True)):
        sound = np.isfinite(cloud).all(axis=1)
        if not np.isfinite(own).all() or not sound.any():
            continue
        corners = own.reshape(-1, 3)[quads]
        normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        middles = corners.mean(axis=1)
        _, nearest = cKDTree(middles).query(cloud[sound])
        found[row, sound] = np.einsum("pi,pi->p", middles[nearest] - cloud[sound], normals[nearest])
    return found


def _at(times: NDArray[np.float64], outputs: NDArray[np.float64], moments: NDArray[np.float64]) -> NDArray[np.float64]:
    """Interpolate outputs (k, d) at moments (m,): a motion by a cubic spline, equilibria linearly.

    Before the first and after the last of the ``times`` (k,), the outputs are constant.
    """
    if outputs.shape[0] == 1:
        return np.repeat(outputs, moments.size, axis=0)
    inside = np.clip(moments, times[0], times[-1])
    if outputs.shape[0] > 3 and times[0] == 0.0:
        return CubicSpline(times, outputs)(inside)
    return np.stack([np.interp(inside, times, column) for column in outputs.T], axis=1).reshape(moments.size, -1)

# SPDX-License-Identifier: Apache-2.0
"""Comparison of simulated with measured positions of probes; estimates of moduli and of the body's shape from it."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array, csr_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from gdfe_ros.actuators.embedding import Embedding
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.scene.scene import Scene

_KEPT = 600
"""Largest number of stored states, and of stored measurements of each probe."""
LATEST = 5.0
"""A measurement is dropped after this time [s] if the simulation has no state of the same time."""
_MOTION = 4.0
"""A measured motion counts if it is larger than this number of its standard deviations."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Sample:
    """State of the simulation at a time on the robot's clock.

    Attributes:
        stamp: the time [s].
        places: dict from probe to its position (3,) [m].
        derivatives: dict from probe to the derivatives (3, n) [m] with respect to the logarithms of the moduli; None
            if this state has no derivatives.
        duration: time that the step to this state took [s]; before, the simulation did not know its last commands.
    """

    stamp: float
    places: Mapping[str, NDArray[np.float64]]
    derivatives: Mapping[str, NDArray[np.float64]] | None
    duration: float = 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Deviation:
    """A measured position, and the simulated position at the same time.

    Attributes:
        stamp: time of the measurement on the robot's clock [s].
        probe: name of the probe.
        measured, simulated: positions (3,) [m].
        spread: largest distance [m] by which the simulated probe moves away from ``simulated`` within the uncertainty
            of the times, or the measured motion in this time if it is larger.
        derivatives: derivatives of the simulated position, as in `Sample`; None if there are none, and if the robot
            moves while the simulation is at rest: its commands then do not explain its position.
    """

    stamp: float
    probe: str
    measured: NDArray[np.float64]
    simulated: NDArray[np.float64]
    spread: float
    derivatives: NDArray[np.float64] | None

    @property
    def distance(self) -> float:
        """Distance of the measured from the simulated position [m]."""
        return float(np.linalg.norm(self.measured - self.simulated))


class ProbeComparison:
    """Pairs measurements with simulated states of the same time; states are interpolated in time.

    A simulation at rest makes no steps. Its last state then holds for later times. A measurement waits until the
    motions before and after it, within the window, are known.

    Args:
        step: time between two states while the simulation moves [s].
        window: uncertainty of the times of commands and measurements [s].
        noise: standard deviation of the measured positions along an axis [m].
    """

    def __init__(self, step: float, window: float, noise: float = 0.0) -> None:
        self._step, self._window, self._noise = step, window, noise
        self._samples: deque[Sample] = deque(maxlen=_KEPT)
        self._waiting: deque[tuple[float, str, NDArray[np.float64]]] = deque()
        self._measured: dict[str, deque[tuple[float, NDArray[np.float64]]]] = {}

    def measure(self, stamp: float, probe: str, place: NDArray[np.float64]) -> None:
        """Add a measured position (3,) [m] of a probe at a time [s]."""
        measured = self._measured.setdefault(probe, deque(maxlen=_KEPT))
        measured.append((stamp, place))
        self._waiting.append((stamp, probe, place))
        if len(self._waiting) > _KEPT * len(self._measured):
            self._waiting.popleft()

    def add(self, sample: Sample) -> None:
        """Add a state of the simulation, later than all earlier ones."""
        self._samples.append(sample)

    def forget(self) -> None:
        """Discard the states, because the simulation was replaced by one with other moduli."""
        self._samples.clear()

    def pairs(self, now: float, *, idle: bool) -> list[Deviation]:
        """Return and remove the measurements for which a state of the same time is known at the time ``now`` [s].

        ``idle`` is whether the simulation has been at rest since its last state.
        """
        first, last = (self._samples[0].stamp, self._samples[-1].stamp) if self._samples else (np.inf, np.inf)
        # No state follows the last one within a step.
        known = now if idle else min(now, last + self._step)
        first, last = first + self._window, min(now if idle else last, known - self._window)
        waiting = [item for item in self._waiting if now - item[0] <= LATEST]
        self._waiting = deque(item for item in waiting if not first <= item[0] <= last)
        return [self._pair(*item) for item in waiting if first <= item[0] <= last]

    def _pair(self, stamp: float, probe: str, place: NDArray[np.float64]) -> Deviation:
        after = next((i for i, each in enumerate(self._samples) if each.stamp >= stamp), len(self._samples) - 1)
        second, first = self._samples[after], self._samples[max(0, after - 1)]
        span = second.stamp - first.stamp
        # Before the first step after an idle time, the body was at rest: the interval of its motion is one step.
        share = min(1.0, max(0.0, 1.0 - (second.stamp - stamp) / min(span, self._step))) if span > 0.0 else 1.0
        there = (1.0 - share) * first.places[probe] + share * second.places[probe]
        spread, motion = self._spread(stamp, probe, there), self._motion(stamp, probe)
        alone = motion > 0.0 and spread <= self._noise
        return Deviation(
            stamp=stamp,
            probe=probe,
            measured=place,
            simulated=there,
            spread=max(spread, motion),
            derivatives=None if alone or second.derivatives is None else second.derivatives[probe],
        )

    def _spread(self, stamp: float, probe: str, there: NDArray[np.float64]) -> float:
        """Return the largest distance [m] of the probe from ``there`` within the window around a time."""
        before = [each for each in self._samples if each.stamp < stamp - self._window][-1:]
        near = [
            each
            for each in self._samples
            if each.stamp - each.duration - self._window <= stamp <= each.stamp + self._window
        ]
        return max((float(np.linalg.norm(each.places[probe] - there)) for each in (*before, *near)), default=0.0)

    def _motion(self, stamp: float, probe: str) -> float:
        """Return the measured motion [m] within the window around a time; 0 if noise can explain it.

        It is the distance between the mean positions before and after this time.
        """
        near = [(time, place) for time, place in self._measured[probe] if abs(time - stamp) <= self._window]
        before, after = [x for time, x in near if time <= stamp], [x for time, x in near if time >= stamp]
        motion = float(np.linalg.norm(np.mean(after, axis=0) - np.mean(before, axis=0)))
        return motion if motion > _MOTION * self._noise * np.sqrt(1.0 / len(before) + 1.0 / len(after)) else 0.0


SPREAD = 1.0
"""Standard deviation of the logarithm of a modulus before the first measurement: a factor of e."""
FORGETTING = 30.0
"""Time [s] in which the weight of a measurement falls to 1/e, so that moduli may change with temperature and wear."""


class ModulusEstimator:
    r"""Estimates the logarithms of moduli from measured positions.

    With the deviation e (3,) of a measurement from the simulation, and its derivatives H = dx/d(log E), the estimate
    minimises

        sum_k w_k |e_k - H_k d|^2 / sigma_k^2 + |d|^2 / SPREAD^2

    over the correction d, with weights w_k that fade in time (`FORGETTING`). Only the sums A = sum w H^T H / sigma^2,
    b = sum w H^T e / sigma^2 and c = sum w e^T e / sigma^2 are stored. After the simulation has applied a correction,
    `settle` linearises about the new moduli.

    Args:
        count: number of moduli.
    """

    def __init__(self, count: int) -> None:
        self._prior = np.eye(count) / SPREAD**2
        self._information, self._right = np.zeros((count, count)), np.zeros(count)
        self._misfit = self._count = 0.0
        self._moved, self._last = np.zeros(count), None

    def add(self, time: float, deviation: ArrayLike, derivatives: ArrayLike, sigma: float) -> None:
        """Add a measurement.

        Args:
            time: time of the measurement [s].
            deviation: measured minus simulated position (3,) [m].
            derivatives: derivatives of the simulated position with respect to the logarithms of the moduli (3, n) [m].
            sigma: standard deviation of the deviation along an axis [m].
        """
        rows, e = np.asarray(derivatives, dtype=np.float64), np.asarray(deviation, dtype=np.float64)
        if self._last is not None:
            self._fade(np.exp(-max(0.0, time - self._last) / FORGETTING))
        self._last = time if self._last is None else max(time, self._last)
        self._information = self._information + rows.T @ rows / sigma**2
        self._right = self._right + rows.T @ e / sigma**2
        self._misfit, self._count = self._misfit + e @ e / sigma**2, self._count + e.size

    @property
    def correction(self) -> NDArray[np.float64]:
        """Correction d (n,) to add to the logarithms of the simulation's present moduli."""
        return self._solve()[0]

    @property
    def deviations(self) -> NDArray[np.float64]:
        """Relative standard deviations (n,) of the moduli (of their logarithms)."""
        return np.sqrt(np.diag(np.linalg.inv(self._information / self._solve()[1] + self._prior)))

    def _solve(self) -> tuple[NDArray[np.float64], float]:
        """Return the correction (n,), and the ratio of the variance of the measurements to the assumed one, at least 1.

        If a correction leaves larger deviations than the assumed noise, the noise counts as larger (Birge 1932).
        """
        d = np.linalg.solve(self._information + self._prior, self._right - self._prior @ self._moved)
        left = self._misfit - 2.0 * self._right @ d + d @ self._information @ d
        ratio = max(1.0, float(left) / max(1.0, self._count - len(d)))
        right = self._right / ratio - self._prior @ self._moved
        return np.linalg.solve(self._information / ratio + self._prior, right), ratio

    def settle(self, taken: ArrayLike) -> None:
        """Linearise about the moduli after a correction ``taken`` (n,), which the simulation has applied.

        The derivatives of earlier measurements belong to the earlier moduli. Their relative error is about |taken|.
        The weights of these measurements are reduced so that this error moves the estimate by at most one standard
        deviation.
        """
        step = np.asarray(taken, dtype=np.float64)
        change = self._information @ step
        self._moved = self._moved + step
        self._misfit = self._misfit + step @ (change - 2.0 * self._right)
        self._right = self._right - change
        self._fade(1.0 / (1.0 + step @ step * (step @ change)))

    def _fade(self, kept: float) -> None:
        """Multiply the weights of all measurements so far by ``kept``."""
        self._information, self._right = kept * self._information, kept * self._right
        self._misfit, self._count = kept * self._misfit, kept * self._count


_LEAST = 1e-9
"""Weight of the displacement itself; it holds parts of the mesh without probes at their simulated positions."""


class MeasuredBody:
    """Displaces the simulated body so that its probes are at the measured positions, for pictures.

    A robot is measured at its probes only. The displacement u from the simulated body is the smoothest one: it
    minimises |L u|^2 with u = 0 on fixed handles and u = d at the probes, where d is measured minus simulated position.
    L is the Laplacian of the mesh's edges, weighted by the inverse of their lengths. Away from the probes, the real
    robot may have another shape.

    Args:
        scene: the scene of the simulation.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._weights: dict[tuple[str, ...], NDArray[np.float64]] = {}

    def at(self, positions: NDArray[np.float64], deviations: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
        """Return the positions (n, 3) [m] of the measured body.

        Args:
            positions: positions of the simulated vertices (n, 3) [m].
            deviations: dict from each measured probe to its measured minus simulated position (3,) [m].
        """
        names = tuple(name for name in self._scene.probes if name in deviations)
        if names not in self._weights:
            self._weights[names] = _weights(self._scene, names)
        return positions + self._weights[names] @ np.array([deviations[name] for name in names]).reshape(-1, 3)


def _weights(scene: Scene, names: tuple[str, ...]) -> NDArray[np.float64]:
    """Return the derivatives (n, p) of the vertices' displacements with respect to the probes' displacements."""
    count = scene.mesh.n_vertices
    laplacian = _laplacian(scene)
    bending = (laplacian.T @ laplacian + _LEAST * eye_array(count)).tocsc()
    held = [each.vertices for each in scene.handles if each.fixed and not isinstance(each, Obstacle)]
    free = np.setdiff1d(np.arange(count), np.concatenate([np.zeros(0, np.int64), *held]))
    probes = np.stack([_row(scene.probes[name], count) for name in names])
    solve = splu(bending[free][:, free].tocsc()).solve
    found = np.zeros((count, len(names)))
    found[free] = solve(np.ascontiguousarray(probes[:, free].T))
    # The pseudo-inverse ignores probes on fixed handles, and probes that coincide with another probe.
    return found @ np.linalg.pinv(probes @ found, rcond=1e-10, hermitian=True)


def _row(probe: Embedding, count: int) -> NDArray[np.float64]:
    """Return the weights (n,) of the vertices in the position of a probe."""
    row = np.zeros(count)
    np.add.at(row, probe.corners[0], probe.weights[0])
    return row


def _laplacian(scene: Scene) -> csr_array:
    """Return the Laplacian (n, n) of the edges between the corners of each cell, of the undeformed mesh."""
    cells, vertices = scene.mesh.cells, scene.mesh.vertices
    first, second = np.triu_indices(cells.shape[1], 1)
    edges = np.unique(np.sort(np.stack([cells[:, first].ravel(), cells[:, second].ravel()], axis=1), axis=1), axis=0)
    lengths = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    weights = lengths.mean() / lengths
    shape = (len(vertices), len(vertices))
    adjacent = coo_array((np.concatenate([weights, weights]), (edges.ravel("F"), edges[:, ::-1].ravel("F"))), shape)
    degree = adjacent.sum(axis=0)
    return (diags_array(1.0 / np.maximum(degree, 1e-300)) @ (diags_array(degree) - adjacent)).tocsr()

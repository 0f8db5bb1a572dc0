# SPDX-License-Identifier: Apache-2.0
"""Estimate of moduli from measured positions, and the body in the measured shape."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array, csr_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from gdfe_ros.actuators.embedding import Embedding
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.scene.scene import Scene

SPREAD = 1.0
"""Standard deviation of the logarithm of a modulus before the first measurement: a factor of e."""
FORGETTING = 30.0
"""Time [s] after which a measurement counts 1/e: moduli change slowly, by temperature, wear and fatigue."""


class ModulusEstimator:
    r"""Estimates the logarithms of moduli from measured positions.

    With the deviation e (3,) of a measurement from the simulation, and its derivatives H = dx/d(log E), the estimate
    minimises

        sum_k w_k |e_k - H_k d|^2 / sigma_k^2 + |d|^2 / SPREAD^2

    over the correction d. The sums A = sum w H^T H / sigma^2 and b = sum w H^T e / sigma^2 are all that is stored.
    After the simulation has taken the correction, `settle` makes it the new point of linearisation.

    Args:
        count: number of moduli.
    """

    def __init__(self, count: int) -> None:
        self._prior = np.eye(count) / SPREAD**2
        self._information, self._right = np.zeros((count, count)), np.zeros(count)
        self._moved, self._last = np.zeros(count), None

    def add(self, time: float, deviation: ArrayLike, derivatives: ArrayLike, sigma: float) -> None:
        """Add a measurement.

        Args:
            time: of the measurement [s]; earlier measurements are forgotten with the time since then.
            deviation: measured minus simulated position (3,) [m].
            derivatives: of the simulated position with respect to the logarithms of the moduli (3, n) [m].
            sigma: standard deviation of the deviation along an axis [m].
        """
        rows, e = np.asarray(derivatives, dtype=np.float64), np.asarray(deviation, dtype=np.float64)
        if self._last is not None:
            kept = np.exp(-max(0.0, time - self._last) / FORGETTING)
            self._information, self._right = kept * self._information, kept * self._right
        self._last = time if self._last is None else max(time, self._last)
        self._information = self._information + rows.T @ rows / sigma**2
        self._right = self._right + rows.T @ e / sigma**2

    @property
    def correction(self) -> NDArray[np.float64]:
        """The correction d (n,) of the logarithms of the moduli that the simulation has now."""
        return np.linalg.solve(self._information + self._prior, self._right - self._prior @ self._moved)

    @property
    def deviations(self) -> NDArray[np.float64]:
        """Standard deviations (n,) of the logarithms: relative ones of the moduli, if the noise is as assumed."""
        return np.sqrt(np.diag(np.linalg.inv(self._information + self._prior)))

    def settle(self, taken: ArrayLike) -> None:
        """Note that the simulation has taken a correction (n,): deviations are smaller by it from now on."""
        step = np.asarray(taken, dtype=np.float64)
        self._moved = self._moved + step
        self._right = self._right - self._information @ step


_LEAST = 1e-9
"""Weight of the displacement itself, so that parts of the mesh without probes stay at the simulated place."""


class MeasuredBody:
    r"""Displaces the simulated body so that its probes meet the measured points.

    A robot is measured at its probes only. Between them, the displacement u from the simulated body is the smoothest
    one: it minimises :math:`|L u|^2` with the Laplacian L of the mesh's edges, weighted by the inverse of their length,
    u = 0 on fixed handles, and u = d at the probes, where d is measured minus simulated position. This is an
    interpolation for the eye, and not a measurement: away from the probes, the real robot may have another shape.

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
    """Return the displacement of each vertex per displacement of each probe (n, p)."""
    count = scene.mesh.n_vertices
    laplacian = _laplacian(scene)
    bending = (laplacian.T @ laplacian + _LEAST * eye_array(count)).tocsc()
    held = [each.vertices for each in scene.handles if each.fixed and not isinstance(each, Obstacle)]
    free = np.setdiff1d(np.arange(count), np.concatenate([np.zeros(0, np.int64), *held]))
    probes = np.stack([_row(scene.probes[name], count) for name in names])
    solve = splu(bending[free][:, free].tocsc()).solve
    found = np.zeros((count, len(names)))
    found[free] = solve(np.ascontiguousarray(probes[:, free].T))
    # A probe that is held, or that coincides with another one, determines nothing more: least squares leave it out.
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

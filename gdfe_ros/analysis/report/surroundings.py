# SPDX-License-Identifier: Apache-2.0
"""Obstacles, rigid bodies, cables, chambers and contact forces in an animation, packed for an HTML page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.analysis.bag_steps import BagStep
from gdfe_ros.analysis.report.levels import to_levels, to_text
from gdfe_ros.analysis.scenery import Scenery, force_arrows
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.scene import Scene

MOST_FORCES = 200
"""Largest number of arrows in a frame; only the largest forces have arrows."""
KINDS = ("solids", "chambers", "cables")
"""Kinds of things with a constant number of points. Solids and chambers are drawn as triangles, cables as lines."""


class Surroundings:
    """Animation frames of the things around and inside a body, collected by ``add``.

    Args:
        scene: the recorded scene.

    Attributes:
        size: largest size of a frame [bytes] before base64, which adds a third.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._points: dict[str, list[NDArray[np.float64]]] = {kind: [] for kind in KINDS}
        self._pushes: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
        at_rest = Scenery.recorded(scene, {}, scene.mesh.vertices)
        self._cables = [len(cable) for cable in at_rest.cables]
        points = sum(map(len, _shapes(at_rest).values()))
        touches = scene.self_contact is not None or any(isinstance(handle, Obstacle) for handle in scene.handles)
        self.size = 6 * (points + 2 * MOST_FORCES * touches)

    def add(self, step: BagStep, positions: NDArray[np.float64]) -> None:
        """Add a frame with the body's vertices at ``positions`` (n, 3) [m]."""
        around = Scenery.recorded(self._scene, step.samples, positions)
        for kind, points in _shapes(around).items():
            self._points[kind].append(points)
        forces = np.linalg.norm(around.forces, axis=1)
        most = np.argsort(-forces, kind="stable")[:MOST_FORCES]
        self._pushes.append((around.places[most], around.forces[most]))

    def to_page(self) -> tuple[dict[str, Any], dict[str, str]]:
        """Return a description for the page's script, and dict from array name to base64 text.

        All points are 16-bit levels between two opposite corners of one box. A force has the same scale in all frames.
        """
        largest = max((float(forces[0] @ forces[0]) ** 0.5 for _, forces in self._pushes if len(forces)), default=0.0)
        scale = {"largest": largest, "size": self._scene.mesh.size}
        arrows = [force_arrows(places, forces, **scale) for places, forces in self._pushes]
        kept = {kind: np.array(frames).reshape(-1, 3) for kind, frames in self._points.items()}
        kept["forces"] = np.concatenate([each.reshape(-1, 3) for each in arrows]) if arrows else np.zeros((0, 3))
        low, high, levels = to_levels(np.concatenate(list(kept.values())))
        ends = np.cumsum([len(points) for points in kept.values()])[:-1]
        arrays = {f"around-{kind}": to_text(part) for kind, part in zip(kept, np.split(levels, ends), strict=True)}
        frames = max(1, len(self._pushes))
        description = {"low": low.tolist(), "high": high.tolist(), "cables": self._cables, "largest": largest}
        counts = {kind: len(kept[kind]) // frames for kind in KINDS}
        return description | {"counts": counts, "forces": [2 * len(each) for each in arrows]}, arrays


def _shapes(around: Scenery) -> dict[str, NDArray[np.float64]]:
    """Return dict from each of `KINDS` to its points (k, 3) [m]."""
    cables = np.concatenate(around.cables) if around.cables else np.zeros((0, 3))
    return {"solids": _triangles(around.obstacles), "chambers": _triangles(around.chambers), "cables": cables}


def _triangles(faces: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the corners (3 t, 3) of triangles that cover faces (f, 3 or 4, 3)."""
    parts = [each[:, corners] for each in faces for corners in ([0, 1, 2], [0, 2, 3])[: each.shape[1] - 2]]
    return np.concatenate(parts).reshape(-1, 3) if parts else np.zeros((0, 3))

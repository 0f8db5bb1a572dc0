# SPDX-License-Identifier: Apache-2.0
"""Animation of the body's surface and of the things around it, small enough for an HTML page."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.analysis.bag_run import BagStep
from gdfe_ros.analysis.difference_table import unit_of
from gdfe_ros.analysis.scenery import Scenery, face_values, force_arrows
from gdfe_ros.colour_map import NOISE
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.scene import Scene

_LEVELS = 65535


def to_levels(
    values: NDArray[np.floating[Any]], *, least_span: float = 0.0
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.uint16]]:
    """Quantise each column of ``values`` (k, c) to 16-bit levels between its least and its largest value.

    If a column spans less than ``least_span``, its largest value is raised to this span.

    Returns:
        Least values (c,), largest values (c,), and levels (k, c).
    """
    finite = np.where(np.isfinite(values), values, np.nan)
    low = np.nan_to_num(np.nanmin(finite, axis=0)).astype(np.float64) if values.size else np.zeros(values.shape[1])
    high = np.nan_to_num(np.nanmax(finite, axis=0)).astype(np.float64) if values.size else np.ones(values.shape[1])
    high = np.maximum(high, low + least_span)
    span = np.where(high > low, high - low, 1.0)
    levels = np.nan_to_num((finite - low) / span * _LEVELS).round()
    return low, high, levels.astype("<u2")


def to_text(values: NDArray[Any]) -> str:
    """Return the bytes of an array in base64."""
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")


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
        at_rest = Scenery.from_samples(scene, {}, scene.mesh.vertices)
        self._cables = [len(cable) for cable in at_rest.cables]
        points = sum(map(len, _shapes(at_rest).values()))
        touches = scene.self_contact is not None or any(isinstance(handle, Obstacle) for handle in scene.handles)
        self.size = 6 * (points + 2 * MOST_FORCES * touches)

    def add(self, step: BagStep, positions: NDArray[np.float64]) -> None:
        """Add a frame with the body's vertices at ``positions`` (n, 3) [m]."""
        around = Scenery.from_samples(self._scene, step.samples, positions)
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
    """Return a dict from each of `KINDS` to its points (k, 3) [m]."""
    cables = np.concatenate(around.cables) if around.cables else np.zeros((0, 3))
    return {"solids": _triangles(around.obstacles), "chambers": _triangles(around.chambers), "cables": cables}


def _triangles(faces: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the corners (3 t, 3) of triangles that cover faces (f, 3 or 4, 3)."""
    parts = [each[:, corners] for each in faces for corners in ([0, 1, 2], [0, 2, 3])[: each.shape[1] - 2]]
    return np.concatenate(parts).reshape(-1, 3) if parts else np.zeros((0, 3))


MOST_FRAMES = 400
BUDGET = 12 << 20
"""Limit of the size of all frames [B], before base64 adds a third."""
LABELS = {
    "eps_eq": "equivalent strain",
    "J": "elastic volume ratio J",
    "omega": "shape factor",
    "tangent": "tangent modulus",
    "energy_density": "energy density",
    "ux": "displacement along x",
    "uy": "displacement along y",
    "uz": "displacement along z",
}
"""Dict from published field to its name on the page."""
_NOT_COLOURS = frozenset({"x", "y", "z"})


@dataclass(eq=False)
class Animation:
    """Frames of the body's surface (its skin, if it has one), collected by ``add``.

    Args:
        scene: the recorded scene.
        steps: number of steps of the run; it determines which steps become frames.
        fields: topic and name of each published field that can colour the surface.

    Attributes:
        frames: indices of the steps that are frames.
    """

    scene: Scene
    steps: int
    fields: tuple[tuple[str, str], ...]
    frames: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        self._outside, self._around = self.scene.mesh.outside, Surroundings(self.scene)
        points, faces = len(self._outside.corners), len(self._outside.faces)
        size = 6 * points + 2 * faces * max(1, len(self.fields)) + self._around.size
        count = max(2, min(MOST_FRAMES, BUDGET // size, self.steps))
        self.frames = np.unique(np.linspace(0, self.steps - 1, count).round().astype(np.int64))
        self._wanted = set(self.frames.tolist())
        self._times: list[float] = []
        self._failed: list[bool] = []
        self._positions: list[NDArray[np.float32]] = []
        self._colours: dict[tuple[str, str], list[NDArray[np.float32]]] = {name: [] for name in self.fields}

    def add(self, number: int, step: BagStep) -> None:
        """Add step ``number`` of the run if it is a frame and has a mesh and every field."""
        mesh = step.samples.get("mesh")
        if number not in self._wanted or mesh is None or any(topic not in step.samples for topic, _ in self.fields):
            return
        self._times.append(step.record.time)
        self._failed.append(not step.record.converged)
        positions = np.stack([mesh[axis] for axis in "xyz"], axis=1)
        self._positions.append(self._outside.at(positions).astype(np.float32))
        self._around.add(step, positions.astype(np.float64))
        for topic, name in self.fields:
            values = step.samples[topic][name]
            shown = self._outside
            of_cells = topic == "strain"
            on_faces = face_values(self.scene.mesh, values) if of_cells else shown.at(values)[shown.faces].mean(axis=1)
            self._colours[topic, name].append(on_faces.astype(np.float32))

    def to_page(self) -> tuple[dict[str, Any], dict[str, str]]:
        """Return a description for the page's script, and dict from array name to base64 text.

        The page first shows the frame with the largest eps_eq; without strains, the last frame.

        Positions and colours are 16-bit levels between the least and the largest value of the run. Positions have an
        error of at most 1/131070 of the bounding box of the run.
        """
        around, arrays = self._around.to_page()
        arrays["faces"] = to_text(self._outside.faces.astype("<u4"))
        low, high, levels = to_levels(np.array(self._positions).reshape(-1, 3))
        arrays["positions"] = to_text(levels)
        description: dict[str, Any] = {
            "times": self._times,
            "failed": self._failed,
            "vertices": len(self._outside.corners),
            "faces": len(self._outside.faces),
            "corners": self._outside.faces.shape[1],
            "low": low.tolist(),
            "high": high.tolist(),
            "fields": [],
            "first": self._most_strained(),
            "around": around,
        }
        for (topic, name), frames in self._colours.items():
            noise = NOISE * (self.scene.mesh.size if unit_of(name) == "m" else 1.0)
            least, most, colours = to_levels(np.array(frames).reshape(-1, 1), least_span=noise)
            arrays[f"field-{topic}-{name}"] = to_text(colours)
            entry = {
                "id": f"field-{topic}-{name}",
                "name": name,
                "label": LABELS.get(name, name),
                "unit": unit_of(name),
            }
            description["fields"].append(entry | {"low": float(least[0]), "high": float(most[0])})
        return description, arrays

    def _most_strained(self) -> int:
        """Return the index of the frame with the largest eps_eq; the last one if no strain is published."""
        frames = self._colours.get(("strain", "eps_eq"), [])
        return int(np.argmax([np.nanmax(values) for values in frames])) if frames else max(0, len(self._times) - 1)


def colour_fields(step: BagStep) -> tuple[tuple[str, str], ...]:
    """Return topic and name of the published fields that can colour a surface: eps_eq first, displacements last."""
    found = [(topic, name) for topic in ("strain", "mesh") for name in step.samples.get(topic, {})]
    return tuple((topic, name) for topic, name in found if name not in _NOT_COLOURS)

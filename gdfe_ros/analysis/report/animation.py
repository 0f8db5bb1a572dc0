# SPDX-License-Identifier: Apache-2.0
"""Animation of the body's surface and of the things around it, small enough for an HTML page."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.analysis.bag_steps import BagStep
from gdfe_ros.analysis.difference_table import unit_of
from gdfe_ros.analysis.face_values import face_values
from gdfe_ros.analysis.report.levels import to_levels, to_text
from gdfe_ros.analysis.report.surroundings import Surroundings
from gdfe_ros.colour_map import NOISE
from gdfe_ros.mesh import HexMesh
from gdfe_ros.scene import Scene

MOST_FRAMES = 400
BUDGET = 12 << 20
"""Limit of the size of all frames [B], before base64 adds a third."""
LABELS = {
    "eps_eq": "equivalent strain",
    "J": "volume ratio J",
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
        self._outside, self._around = self.mesh.outside, Surroundings(self.scene)
        points, faces = len(self._outside.corners), len(self._outside.faces)
        size = 6 * points + 2 * faces * max(1, len(self.fields)) + self._around.size
        count = max(2, min(MOST_FRAMES, BUDGET // size, self.steps))
        self.frames = np.unique(np.linspace(0, self.steps - 1, count).round().astype(np.int64))
        self._wanted = set(self.frames.tolist())
        self._times: list[float] = []
        self._failed: list[bool] = []
        self._positions: list[NDArray[np.float32]] = []
        self._colours: dict[tuple[str, str], list[NDArray[np.float32]]] = {name: [] for name in self.fields}

    @property
    def mesh(self) -> HexMesh:
        """Undeformed mesh."""
        return self.scene.mesh

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
            on_faces = face_values(self.mesh, values) if of_cells else shown.at(values)[shown.faces].mean(axis=1)
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
            noise = NOISE * (self.mesh.size if unit_of(name) == "m" else 1.0)
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

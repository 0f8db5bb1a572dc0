# SPDX-License-Identifier: Apache-2.0
"""Animation of the surface, packed small enough for an HTML page."""

from __future__ import annotations

import base64
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.analysis.bag_steps import BagStep
from gdfe_ros.analysis.difference_table import unit_of
from gdfe_ros.colour_map import NOISE
from gdfe_ros.mesh import HexMesh

MOST_FRAMES = 400
BUDGET = 12 << 20
"""Limit of the bytes of all frames before base64 adds a third."""
_LEVELS = 65535
_NOT_COLOURS = frozenset({"x", "y", "z"})


@dataclass(eq=False)
class Animation:
    """Frames of the surface, collected by ``add``; it is the skin of a mesh that has one.

    Args:
        mesh: at rest.
        steps: number of steps of the run, which determines the thinning.
        fields: published fields of cells and vertices for colouring the surface.

    Attributes:
        frames: indices of the steps that are frames.
    """

    mesh: HexMesh
    steps: int
    fields: tuple[tuple[str, str], ...]
    frames: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        self._outside = self.mesh.outside
        points, faces = len(self._outside.corners), len(self._outside.faces)
        size = 6 * points + 2 * faces * max(1, len(self.fields))
        count = max(2, min(MOST_FRAMES, BUDGET // size, self.steps))
        self.frames = np.unique(np.linspace(0, self.steps - 1, count).round().astype(np.int64))
        self._wanted = set(self.frames.tolist())
        self._times: list[float] = []
        self._positions: list[NDArray[np.float32]] = []
        self._colours: dict[tuple[str, str], list[NDArray[np.float32]]] = {name: [] for name in self.fields}

    def add(self, number: int, step: BagStep) -> None:
        """Add step ``number`` of the run if it is a frame and has a mesh and every field."""
        mesh = step.samples.get("mesh")
        if number not in self._wanted or mesh is None or any(topic not in step.samples for topic, _ in self.fields):
            return
        self._times.append(step.record.time)
        self._positions.append(self._outside.at(np.stack([mesh[axis] for axis in "xyz"], axis=1)).astype(np.float32))
        for topic, name in self.fields:
            values = step.samples[topic][name]
            shown = self._outside
            on_faces = values[shown.cells] if topic == "strain" else shown.at(values)[shown.faces].mean(axis=1)
            self._colours[topic, name].append(on_faces.astype(np.float32))

    def to_page(self) -> tuple[dict[str, Any], dict[str, str]]:
        """Return the description for the page's script, and arrays in base64 by name.

        The page opens on the frame with the largest eps_eq, or on the last one without strains.

        Positions and colours are 16-bit levels between the least and the largest value of the run: positions have an
        error of at most 1/131070 of the bounding box of the run.
        """
        arrays = {"faces": _encode(self._outside.faces.astype("<u4"))}
        low, high, levels = _levels(np.array(self._positions).reshape(-1, 3))
        arrays["positions"] = _encode(levels)
        description: dict[str, Any] = {
            "times": self._times,
            "vertices": len(self._outside.corners),
            "faces": len(self._outside.faces),
            "corners": self._outside.faces.shape[1],
            "low": low.tolist(),
            "high": high.tolist(),
            "fields": [],
            "first": self._most_strained(),
        }
        for (topic, name), frames in self._colours.items():
            noise = NOISE * (self.mesh.size if unit_of(name) == "m" else 1.0)
            least, most, colours = _levels(np.array(frames).reshape(-1, 1), least_span=noise)
            arrays[f"field-{topic}-{name}"] = _encode(colours)
            entry = {"id": f"field-{topic}-{name}", "name": name, "unit": unit_of(name)}
            description["fields"].append(entry | {"low": float(least[0]), "high": float(most[0])})
        return description, arrays

    def _most_strained(self) -> int:
        """Return the index of the frame with the largest eps_eq; the last one if no strain is published."""
        frames = self._colours.get(("strain", "eps_eq"), [])
        return int(np.argmax([np.nanmax(values) for values in frames])) if frames else max(0, len(self._times) - 1)


def colour_fields(step: BagStep) -> tuple[tuple[str, str], ...]:
    """Return the published fields that can colour a surface: eps_eq first, then displacements."""
    found = [(topic, name) for topic in ("strain", "mesh") for name in step.samples.get(topic, {})]
    return tuple((topic, name) for topic, name in found if name not in _NOT_COLOURS)


def _levels(
    values: NDArray[np.float32], *, least_span: float = 0.0
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.uint16]]:
    """Quantise the columns of (k, c) to 16-bit levels; return least, largest and levels.

    The largest value is at least ``least_span`` above the least one.
    """
    finite = np.where(np.isfinite(values), values, np.nan)
    low = np.nan_to_num(np.nanmin(finite, axis=0)).astype(np.float64) if values.size else np.zeros(values.shape[1])
    high = np.nan_to_num(np.nanmax(finite, axis=0)).astype(np.float64) if values.size else np.ones(values.shape[1])
    high = np.maximum(high, low + least_span)
    span = np.where(high > low, high - low, 1.0)
    levels = np.nan_to_num((finite - low) / span * _LEVELS).round()
    return low, high, levels.astype("<u2")


def _encode(values: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")

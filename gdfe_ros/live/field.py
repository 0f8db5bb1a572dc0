# SPDX-License-Identifier: Apache-2.0
"""Fields that colour the body, and their colour range."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.colour_map import NOISE, VIRIDIS, colour_range
from gdfe_ros.live.surface import DrawnSurface
from gdfe_ros.live.view import View
from gdfe_ros.scene.scene import Scene


@dataclass(frozen=True)
class Field:
    """A field that colours the body.

    Attributes:
        label: name for users, with the unit.
        values: function that returns the field at the points of the surface (k,) after a step.
        noise: smallest width of the colour range, in the unit of the field; it hides smaller differences, which are
            noise.
    """

    label: str
    values: Callable[[View, DrawnSurface], NDArray[np.float64]]
    noise: float = NOISE


def fields_of(scene: Scene) -> dict[str, Field]:
    """Return the fields of a scene by label; fields of the cells are averaged at the surface points."""

    def of_cells(label: str, name: str) -> Field:
        return Field(label, lambda view, surface: surface.at_vertices(view.fields()[name]))

    def of_vertices(label: str, give: Callable[[View], NDArray[np.floating]]) -> Field:
        noise = NOISE * scene.mesh.size
        return Field(label, lambda view, surface: np.linalg.norm(surface.outside.at(give(view)), axis=1), noise)

    found = [
        of_cells("equivalent strain [1]", "eps_eq"),
        of_vertices("displacement [m]", lambda view: view.positions - scene.mesh.vertices),
        of_cells("volume ratio [1]", "J"),
        of_cells("energy density [J/m^3]", "energy_density"),
        of_cells("tangent modulus [Pa]", "tangent"),
        of_cells("shape factor [1]", "omega"),
    ]
    if scene.dynamics:
        found.append(of_vertices("speed [m/s]", lambda view: view.velocities))
    return {field.label: field for field in found}


class Range:
    """Colour range from the smallest to the largest value of a frame, or a constant range.

    Attributes:
        low, high: bounds; unless ``held``, the smallest and largest value of the last frame.
        held: whether the bounds stay constant.
    """

    def __init__(self) -> None:
        self.low, self.high, self.held = 0.0, 0.0, False

    def shares(self, values: NDArray[np.float64], *, noise: float = NOISE) -> NDArray[np.float64]:
        """Return values (k,) relative to the range, 0 to 1; unless ``held``, the range is first fitted to the values.

        The fitted range has at least the width ``noise``.
        """
        if not self.held:
            self.low, self.high = colour_range(float(values.min()), float(values.max()), noise=noise)
        span = self.high - self.low
        return np.clip((values - self.low) / span, 0.0, 1.0) if span > 0.0 else np.zeros_like(values)


def legend(label: str, bounds: Range) -> str:
    """Return a colour bar with its numbers, as HTML."""
    stops = ",".join("rgb({:.0f},{:.0f},{:.0f})".format(*(255 * stop)) for stop in VIRIDIS)
    numbers = "".join(f"<span>{value:.3g}</span>" for value in np.linspace(bounds.low, bounds.high, 5))
    return (
        f'<div id="legend" style="font-size:0.8em;padding:0 0.8em 0.5em"><div>{label}</div>'
        f'<div style="height:0.8em;border-radius:2px;background:linear-gradient(90deg,{stops})"></div>'
        f'<div style="display:flex;justify-content:space-between">{numbers}</div></div>'
    )

# SPDX-License-Identifier: Apache-2.0
"""Simulated quantities that are compared with measurements."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import GdfeError
from gdfe_ros.scene.scene import Scene

if TYPE_CHECKING:
    from gdfe_ros.simulation import Simulation


class QuantityKind(Enum):
    """Kinds of quantities. Positions are vectors [m], which a recording may state in a frame of its own."""

    PROBE = "probe"
    MEAN = "mean"
    HANDLE = "handle"
    VERTICES = "vertices"
    SURFACE = "surface"
    FORCE = "force"
    EFFORT = "effort"
    EXTENT = "extent"


POSITIONS = (QuantityKind.PROBE, QuantityKind.MEAN, QuantityKind.HANDLE, QuantityKind.VERTICES, QuantityKind.SURFACE)
CLOUDS = (QuantityKind.VERTICES, QuantityKind.SURFACE)


@dataclass(frozen=True, eq=False)
class Observable:
    """A simulated quantity.

    Attributes:
        kind: kind of the quantity.
        name: name of the probe, handle or actuator.
        vertices: indices (k,) of the vertices whose mean position is the quantity.
        displacement: whether positions are relative to the undeformed body.
        actuator_unit: SI unit of an actuator's quantity.
    """

    kind: QuantityKind
    name: str = ""
    vertices: NDArray[np.int32] | None = None
    displacement: bool = False
    actuator_unit: str = ""

    @property
    def unit(self) -> str:
        """SI unit of the values."""
        return "m" if self.kind in POSITIONS else "N" if self.kind is QuantityKind.FORCE else self.actuator_unit

    def of(self, simulation: Simulation) -> NDArray[np.float64]:
        """Return the present values: (3,) for a point or a force, (1,) for an actuator, (3 n,) for n vertices."""
        values = self._values(simulation)
        return (values - self._at_rest(simulation.scene)) if self.displacement else values

    def _values(self, simulation: Simulation) -> NDArray[np.float64]:
        if self.kind is QuantityKind.PROBE:
            return simulation.scene.probes[self.name].at(simulation.positions)[0]
        if self.kind is QuantityKind.MEAN:
            return simulation.positions[self.vertices].mean(axis=0)
        if self.kind is QuantityKind.HANDLE:
            return np.array(simulation.handle_pose(self.name).translation)
        if self.kind in CLOUDS:
            return simulation.positions.ravel()
        if self.kind is QuantityKind.FORCE:
            result = simulation.result
            return np.zeros(3) if result is None else np.array(result.reactions[self.name][:3])
        state = simulation.actuator_states()[self.name]
        return np.array([state.effort if self.kind is QuantityKind.EFFORT else state.extent])

    def _at_rest(self, scene: Scene) -> NDArray[np.float64]:
        if self.kind is QuantityKind.PROBE:
            return scene.probes[self.name].at(scene.mesh.vertices)[0]
        if self.kind is QuantityKind.MEAN:
            return scene.mesh.vertices[self.vertices].mean(axis=0)
        return scene.mesh.vertices.ravel() if self.kind in CLOUDS else np.zeros(1)


def require_known(kind: QuantityKind, name: str, scene: Scene, where: str) -> None:
    """Check that the scene has the probe, handle or actuator ``name``.

    Raises:
        GdfeError: the scene does not have it.
    """
    known = {
        QuantityKind.PROBE: list(scene.probes),
        QuantityKind.HANDLE: [handle.name for handle in scene.handles],
        QuantityKind.FORCE: [handle.name for handle in scene.handles],
        QuantityKind.EFFORT: [actuator.name for actuator in scene.actuators],
        QuantityKind.EXTENT: [actuator.name for actuator in scene.actuators],
    }.get(kind)
    if known is not None and name not in known:
        noun = {QuantityKind.PROBE: "probe", QuantityKind.EFFORT: "actuator", QuantityKind.EXTENT: "actuator"}.get(
            kind, "handle"
        )
        raise GdfeError(f"{where}: no {noun} {name!r} in scene {scene.name!r}; it has {', '.join(known) or 'none'}")

# SPDX-License-Identifier: Apache-2.0
"""Growth of cells, done where it costs nothing: in the operators of their rest shape.

With F_e = F G^-1 the gradients of a cell become G^-T g_a, its volume det G V and its edges G d, while its hourglass
vectors stay as they are (they are blind to linear maps). The element kernels then see the elastic part of F alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gdfe_ros.actuators.actuator import Growth
from gdfe_ros.mesh.operators import ShapeOperators
from gdfe_ros.solver.blocks import Blocks, block_geometry


class GrownShape:
    """The operators of a body at the present growth; the body's arrays are overwritten in place.

    Args:
        shape: operators of the ungrown body.
        blocks: the same for the kernels.
        growths: what grows.
    """

    def __init__(self, shape: ShapeOperators, blocks: Blocks, growths: Sequence[Growth]) -> None:
        self._shape, self._blocks, self._growths = shape, blocks, tuple(growths)
        self.cells = np.unique(np.concatenate([growth.cells for growth in self._growths]))
        own = self.cells
        self._volume, self._gradient = shape.volume[own].copy(), shape.gradient[own].copy()
        self._edges = (shape.edge_axes * shape.edge_lengths[..., None])[own]
        self._reference = shape.reference[own].copy()
        self._rows = [np.searchsorted(own, growth.cells) for growth in self._growths]
        self.stretch = np.tile(np.eye(3), (len(own), 1, 1))

    def apply(self, commands: Mapping[str, float]) -> None:
        """Set the growth to a command for each name."""
        stretch = np.tile(np.eye(3), (len(self.cells), 1, 1))
        for growth, rows in zip(self._growths, self._rows, strict=True):
            stretch[rows] += commands[growth.name] * (growth.stretch - np.eye(3))
        if (stretch == self.stretch).all():
            return
        self.stretch = stretch
        shape, own, inverse = self._shape, self.cells, np.linalg.inv(stretch)
        edges = np.einsum("eij,ekj->eki", stretch, self._edges)
        lengths = np.linalg.norm(edges, axis=2)
        shape.volume[own] = self._volume * np.linalg.det(stretch)
        shape.gradient[own] = self._gradient @ inverse
        shape.edge_axes[own] = edges / lengths[..., None]
        shape.edge_lengths[own] = lengths
        shape.reference[own] = self._reference @ inverse
        self._blocks.geometry[...] = block_geometry(shape, self._blocks.element)

    def volume_ratio(self, growth: Growth) -> float:
        """Return the mean det G over the cells of a growth."""
        rows = self._rows[self._growths.index(growth)]
        return float(np.average(np.linalg.det(self.stretch[rows]), weights=self._volume[rows]))

# SPDX-License-Identifier: Apache-2.0
"""Operators of a body's elements at a given growth, by element and in blocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.operators import ShapeOperators
from gdfe_ros.solver.elements.blocks import Blocks


@dataclass(frozen=True, eq=False)
class Operators:
    """The elements' rest shape; an immutable value.

    Attributes:
        shape: operators of the elements.
        blocks: the same operators in the layout of the kernels' blocks.
        stretch: (k, 3, 3) growth of the cells that can grow; (0, 3, 3) if none can.
    """

    shape: ShapeOperators
    blocks: Blocks
    stretch: NDArray[np.float64]

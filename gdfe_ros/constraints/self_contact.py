# SPDX-License-Identifier: Apache-2.0
"""Surfaces of a mesh that cannot enter each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

NAME = "(self)"
"""Of what touches there, in `StepResult.contacts`; nothing in a scene can be called that."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SelfContact:
    """Contact of a mesh with itself: of its parts with each other, and of each with itself.

    Attributes:
        quads: (q, 4) int32 boundary faces that take part.
        friction: Coulomb's coefficient.
    """

    quads: NDArray[np.int32]
    friction: float = 0.0

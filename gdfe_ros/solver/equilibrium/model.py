# SPDX-License-Identifier: Apache-2.0
"""What all solves of a body have in common."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.descent.minimiser import Minimiser
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.tangent.level import TangentLevel
from gdfe_ros.solver.terms.actuation import Actuation


@dataclass(frozen=True, eq=False)
class Model:
    """What all solves of a body share: the body, what acts on it, its handles, and what descends in its potential.

    ``level`` holds the tangents that precondition a slender body; None where the constant matrix does. Without
    ``softening`` hourglass scales stay: a change of them would make or take energy. ``softest`` (3 r,) is the
    constant matrix times the softest motion at rest, as far as it is known; None where nothing moves.
    """

    body: Body
    actuation: Actuation
    handles: HandleMotions
    minimiser: Minimiser
    level: TangentLevel | None = None
    softening: bool = True
    softest: NDArray[np.float64] | None = None

# SPDX-License-Identifier: Apache-2.0
"""Data common to all solves of a body."""

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
    """Data common to all solves of a body: body, terms, handles, and minimiser.

    Attributes:
        body: the discretised body.
        actuation: the external terms.
        handles: the kinematics of its handles.
        minimiser: minimises the potential.
        level: tangent preconditioner of a slender body; None if the constant matrix is the preconditioner.
        softening: whether hourglass scales follow the strain. With ``newmark`` they stay constant, because a change of
            scale would create or remove energy.
        softest: (3 r,) the constant matrix times an estimate of the undeformed body's softest mode; None if nothing
            can move.
    """

    body: Body
    actuation: Actuation
    handles: HandleMotions
    minimiser: Minimiser
    level: TangentLevel | None = None
    softening: bool = True
    softest: NDArray[np.float64] | None = None

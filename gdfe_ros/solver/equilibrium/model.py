# SPDX-License-Identifier: Apache-2.0
"""Data common to all solves of a body."""

from __future__ import annotations

from dataclasses import dataclass

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.descent.minimiser import Minimiser
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.terms.actuation import Actuation


@dataclass(frozen=True, eq=False)
class Model:
    """Data common to all solves of a body: body, terms, handles, and minimiser.

    Attributes:
        body: the discretised body.
        actuation: the external terms.
        handles: the kinematics of its handles.
        minimiser: minimises the potential.
        softening: whether hourglass scales follow the strain. With ``newmark`` they stay constant, because a change of
            scale would create or remove energy.
        moving: whether inertia is among the terms.
    """

    body: Body
    actuation: Actuation
    handles: HandleMotions
    minimiser: Minimiser
    softening: bool = True
    moving: bool = False

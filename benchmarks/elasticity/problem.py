# SPDX-License-Identifier: Apache-2.0
"""The problems: a unit cube whose far face is stretched, pushed or twisted, and the measure of error."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.materials import StableNeoHookean

Array = NDArray[np.float64]
LATTICE = 4
"""Number of intervals of the lattice of points at which positions are compared; every mesh has nodes there."""
OWN = "gdfe_ros"
"""Beginning of the names of this solver's rows."""
LEVELS = (2, 4, 6, 8, 10)
"""Numbers of quadratic cells along an edge; linear cells are half as large, so that the nodes are the same."""
RATIOS = (0.3, 0.45, 0.49, 0.499, 0.4999)
"""The benchmark's sweep of nu; its lambda is 2 mu nu / (1 - 2 nu)."""
DECREMENT = 1e-6
"""Squared Newton decrement, divided by mu times the volume, below which a solve has converged."""


class Kind(str, Enum):
    """What happens to the far face."""

    STRETCH = "stretch"
    """The distance of the two faces is multiplied by the amount."""
    TWIST = "twist"
    """The far face is turned about the cube's axis by the amount [rad]."""


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A cube of 1 m with two clamped faces, x = 0 and x = 1.

    Attributes:
        kind, amount: motion of the far face.
        ratio: the benchmark's nu.
        mu: the benchmark's mu [Pa].
    """

    kind: Kind
    amount: float
    ratio: float
    mu: float = 1.0

    @property
    def name(self) -> str:
        """Name in the tables."""
        what = "compression" if self.kind is Kind.STRETCH and self.amount < 1.0 else self.kind.value
        return f"{what} {self.amount:g}, nu {self.ratio:g}" + (f", mu {self.mu:g} Pa" if self.mu != 1.0 else "")

    @property
    def lame(self) -> float:
        """The benchmark's lambda [Pa]."""
        return 2.0 * self.mu * self.ratio / (1.0 - 2.0 * self.ratio)

    @property
    def law(self) -> StableNeoHookean:
        """The material with Lame's constants 3/4 mu and lambda - 5/8 mu: the benchmark's energy."""
        shear, lame = 0.75 * self.mu, self.lame - 0.625 * self.mu
        poisson = 0.5 * lame / (lame + shear)
        return StableNeoHookean(young=2.0 * shear * (1.0 + poisson), poisson=poisson)

    @property
    def pose(self) -> Pose:
        """Motion of the far face, whose centre is (1, 0, 0)."""
        if self.kind is Kind.TWIST:
            return Pose(rotation=(self.amount, 0.0, 0.0))
        return Pose(translation=(self.amount - 1.0, 0.0, 0.0))

    def moved(self, points: Array, load: float = 1.0) -> Array:
        """Return the displacements (k, 3) [m] of points of the far face, at a fraction ``load`` of the motion."""
        if self.kind is Kind.TWIST:
            c, s = np.cos(load * self.amount), np.sin(load * self.amount)
            return points @ np.array([[0.0, 0.0, 0.0], [0.0, c - 1.0, s], [0.0, -s, c - 1.0]])
        return np.tile([load * (self.amount - 1.0), 0.0, 0.0], (len(points), 1))

    def reaction(self, points: Array, displacement: Array, forces: Array) -> float:
        """Return the far face's force along x [N], or its moment about the axis [N m]; all arrays are (n, 3)."""
        far = points[:, 0] > 1.0 - 1e-9
        if self.kind is Kind.STRETCH:
            return float(forces[far, 0].sum())
        return float(np.cross((points + displacement)[far], forces[far])[:, 0].sum())


def _sweep(kind: Kind, amount: float, *ratios: float) -> list[Problem]:
    return [Problem(kind=kind, amount=amount, ratio=ratio) for ratio in ratios]


PROBLEMS = (
    *_sweep(Kind.STRETCH, 1.3, *RATIOS),
    *_sweep(Kind.STRETCH, 0.9, 0.3, 0.499),
    *(problem for turn in (0.3, 0.6, 0.9, 1.2) for problem in _sweep(Kind.TWIST, turn, 0.3)),
    *_sweep(Kind.TWIST, 1.2, 0.4999),
    Problem(kind=Kind.TWIST, amount=0.6, ratio=0.3, mu=1e6),
)
"""The strata: motions, nu and stiffness; each is solved at its `levels`."""


def levels(problem: Problem, row: str, most: int) -> list[int]:
    """Return the levels up to ``most`` at which a row solves a problem; the largest meshes take most of the time.

    This solver has finer ones, so that its range of errors includes those of rows with more accurate elements.
    """
    large = problem.kind is Kind.STRETCH and problem.amount == 1.3 and problem.ratio in (0.3, 0.49)
    if row.startswith(OWN):
        finest = 10 if large else 8
    elif large:
        finest = 8
    else:
        finest = 6 if problem.kind is Kind.STRETCH or problem.amount == 1.2 else 4
    return [level for level in LEVELS if level <= min(finest, most)]


def lattice(points: Array) -> NDArray[np.intp]:
    """Return the nodes at the inner points of the lattice, in the same order for every mesh.

    Args:
        points: undeformed nodes (n, 3) [m], with x from 0 to 1, y and z from -0.5 to 0.5.
    """
    place = LATTICE * (points + np.array([0.0, 0.5, 0.5]))
    inner = (np.abs(points[:, 0] - 0.5) < 0.5 - 1e-9) & (np.abs(place - np.rint(place)).max(axis=1) < 1e-6)
    nodes = np.flatnonzero(inner)
    found = nodes[np.lexsort(np.rint(place[nodes]).T)]
    if len(found) != (LATTICE - 1) * (LATTICE + 1) ** 2:
        raise ValueError(f"{len(found)} nodes of the mesh are inner points of the lattice of {LATTICE} intervals")
    return found


def run(problem: Problem, points: Array, displacement: Array, forces: Array, **more: Any) -> dict[str, Any]:
    """Return what a report keeps of a run: lattice displacements [m], the reaction, unknowns and ``more``."""
    return {
        "problem": problem.name,
        "unknowns": 3 * len(points),
        "displacement": displacement[lattice(points)].tolist(),
        "reaction": problem.reaction(points, displacement, forces),
        **more,
    }


def errors(found: dict[str, Any], reference: dict[str, Any]) -> dict[str, float]:
    """Return the mean distance from the reference over its mean displacement, and the force's relative error."""
    here, there = np.array(found["displacement"]), np.array(reference["displacement"])
    distance = np.linalg.norm(here - there, axis=1).mean()
    return {
        "error": float(distance / np.linalg.norm(there, axis=1).mean()),
        "force": float(found["reaction"] / reference["reaction"] - 1.0),
    }

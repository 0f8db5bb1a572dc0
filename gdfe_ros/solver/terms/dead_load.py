# SPDX-License-Identifier: Apache-2.0
"""Dead loads as terms: forces of constant magnitude and direction, with the energy E = -s sum_v f_v . (x_v - X_v)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.load import Load
from gdfe_ros.compiled import kernel
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.state import Saved
from gdfe_ros.solver.terms.term import Term, as_arrays, term_kernel

FACTOR, FORCES = 0, 1
"""Offsets in ``reals`` of the factor s, and of the forces f_v [N], each followed by its rest position X_v [m]."""


@kernel
def dead_load_energy(x, reals, integers, force, size):
    """Return the energy [J] of a dead load and add its gradient; `term_kernel` needs this signature."""
    energy, factor = 0.0, reals[FACTOR]
    if factor == 0.0:
        return 0.0
    for i in range(len(integers)):
        v = integers[i]
        for axis in range(3):
            pull = factor * reals[FORCES + 6 * i + axis]
            work = pull * (x[v, axis] - reals[FORCES + 6 * i + 3 + axis])
            energy -= work
            size[0] += abs(work)
            force[v, axis] -= pull
    return energy


@term_kernel
def _entry(x, n, reals, k, integers, i, force, size):
    return dead_load_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


class DeadLoadTerm(Term):
    """A load with its commanded factor.

    Args:
        load: load of the scene.
        body: the body on which it acts.
    """

    kernel, exact = _entry, True

    def __init__(self, load: Load, body: Body) -> None:
        self._forces, self._rest = load.forces(body.rest, body.cells), body.rest
        acted = np.flatnonzero(self._forces.any(axis=1)).astype(np.int32)
        numbers = np.concatenate([self._forces[acted], body.rest[acted]], axis=1).ravel()
        super().__init__(load.name, np.concatenate([[0.0], numbers]), acted)

    def begin(self, commands: Mapping[str, float], saved: Saved, positions: NDArray[np.float64], ratio: float) -> None:
        """Set the factor of the load."""
        self.reals[FACTOR] = commands[self.name]

    def potential(self, positions: NDArray[np.float64], command: float) -> tuple[float, float]:
        """Return the potential [J] at ``positions`` (n, 3) [m] and its derivative with respect to ``command``."""
        slope = -float(np.vdot(self._forces, positions - self._rest))
        return command * slope, slope

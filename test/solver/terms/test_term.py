# SPDX-License-Identifier: Apache-2.0
"""A term defined outside the package: it acts, it is saved, and it changes nothing where it is absent."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import sparse

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.checkpoint import load_state, save_state
from gdfe_ros.compiled import kernel
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.state import Saved
from gdfe_ros.solver.terms.term import Term, TermTable, as_arrays, term_kernel
from test.differences import assert_derivative
from test.written import advance

LIFT = Command(handles={"tip": Pose((0.0, 0.0, 0.05))})


@kernel
def bed_energy(x, reals, integers, force, size):
    """Add the energy [J] k/2 sum_v (z_v - Z_v)^2 of springs and its gradient [N]; return the energy.

    k = reals[0] is the stiffness [N/m], the rest of ``reals`` the undeformed heights Z [m], ``integers`` the vertices.
    """
    energy = 0.0
    for i in range(len(integers)):
        stretch = x[integers[i], 2] - reals[1 + i]
        energy += 0.5 * reals[0] * stretch * stretch
        force[integers[i], 2] += reals[0] * stretch
    size[0] += energy
    return energy


@term_kernel
def _bed_entry(x, n, reals, k, integers, i, force, size):
    return bed_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


class Bed(Term):
    """A bed of vertical springs under all vertices, which counts the solves."""

    kernel = _bed_entry

    def __init__(self, body: Body, stiffness: float) -> None:
        self._stiffness = stiffness
        numbers = np.array([stiffness, *body.rest[:, 2]])
        super().__init__("bed", numbers, np.arange(len(body.rest), dtype=np.int32))

    def stiffness(self) -> sparse.spmatrix:
        """Return the springs' stiffness as a diagonal matrix."""
        return sparse.diags(np.full(len(self.integers), self._stiffness / 3.0)).tocsc()

    def neutral(self) -> Saved:
        """Return a count of zero solves."""
        return {"solves": np.zeros(1)}

    def finish(self, saved: Saved, positions: NDArray[np.float64]) -> Saved:
        """Return the count increased by one."""
        return {"solves": saved["solves"] + 1.0}

    def report(self, positions: NDArray[np.float64]) -> dict[str, float]:
        """Return the force on the bed [N]."""
        return {"force": float(self._stiffness * (positions[:, 2] - self.reals[1:]).sum())}


class KnownBed(Bed):
    """The same bed with its exact tangents."""

    exact = True

    def couplings(self) -> NDArray[np.int32]:
        """Return each vertex by itself."""
        return self.integers[:, None].copy()

    def tangents(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the stiffness [N/m] of each vertex in z."""
        return np.tile(np.diag([0.0, 0.0, self._stiffness]), (len(self.integers), 1, 1))


def _simulation(stiffness: float | None, kind: type[Bed] = Bed) -> Simulation:
    terms = () if stiffness is None else [lambda body: kind(body, stiffness)]
    keys = {"mesh.bar.cells": [10, 2, 2], "solver.tolerance": 1e-7}
    return Simulation(load_scene("bend5", overrides=keys), terms=terms)


def test_a_term_from_outside_carries_its_share() -> None:
    """The handles of a lifted bar on springs carry the force of the springs, and the step result reports that force."""
    result = advance(_simulation(2.0), LIFT)
    carried = sum(wrench[2] for wrench in result.reactions.values())
    assert carried == pytest.approx(result.terms["bed"]["force"], rel=1e-3)
    assert result.terms["bed"]["force"] > 0.1


def test_a_stiff_bed_needs_no_more_iterations() -> None:
    """A solve knows a stiff bed by its part of the constant matrix, or exactly by its tangents.

    With the tangents it takes less than three times the iterations of a soft bed. With the matrix alone it takes fewer
    than the 97 that the constant matrix as preconditioner took.
    """
    soft, stiff = (_simulation(stiffness).step(LIFT) for stiffness in (0.01, 1000.0))
    known = advance(_simulation(1000.0, KnownBed), LIFT)
    assert stiff.converged
    assert stiff.iterations < 60
    assert known.iterations < 3 * soft.iterations
    np.testing.assert_allclose(known.positions, stiff.positions, atol=1e-6)


def test_without_springs_nothing_changes() -> None:
    """A bed without stiffness leaves the equilibrium unchanged."""
    plain, bedded = _simulation(None).step(LIFT), _simulation(0.0).step(LIFT)
    np.testing.assert_allclose(bedded.positions, plain.positions, atol=1e-4 * 0.4)
    assert plain.terms == {}


def test_what_a_term_saves_is_part_of_the_state() -> None:
    """A run saved between two steps continues elsewhere with the same bits, with the term's saved count."""
    first, second = _simulation(2.0), _simulation(2.0)
    first.step(LIFT)
    load_state(second, save_state(first))
    results = [each.step(Command(handles={"tip": Pose((0.0, 0.0, 0.06))})) for each in (first, second)]
    np.testing.assert_array_equal(results[0].positions, results[1].positions)
    counts: list[Mapping] = [each.snapshot().state.terms["bed"]["solves"] for each in (first, second)]
    assert counts[0] == counts[1] == [2.0]


def test_the_force_is_the_slope_of_the_energy() -> None:
    """The packed kernel's force equals central differences of its energy; the term's arrays are views of the table."""
    body = _simulation(None).stepper.body
    term = Bed(body, 3.0)
    table = TermTable.pack([term])
    assert np.shares_memory(term.reals, table.reals)
    assert_derivative(table, body.rest + 0.01 * np.random.default_rng(0).normal(size=body.rest.shape))

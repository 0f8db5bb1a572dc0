# SPDX-License-Identifier: Apache-2.0
"""Comparisons of the forces and tangents of terms with central differences along random directions."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.solver.terms.term import Term, TermTable, terms_energy


def force_of(x: np.ndarray, table: TermTable) -> np.ndarray:
    """Return the derivative (n, 3) [N] of the energy of the terms of a table at ``x`` (n, 3) [m]."""
    force = np.zeros_like(x)
    terms_energy(x, table, force, np.zeros(1))
    return force


def assert_derivative(table: TermTable, x: np.ndarray, h: float = 1e-7) -> None:
    """Require the force of a table's terms to equal differences of their energy, of step ``h`` [m]."""
    random, force, scratch = np.random.default_rng(1), force_of(x, table), np.zeros_like(x)
    for _ in range(5):
        way = random.standard_normal(x.shape)
        high, low = (terms_energy(x + side * way, table, scratch, np.zeros(1)) for side in (h, -h))
        assert (high - low) / (2 * h) == pytest.approx(np.vdot(force, way), rel=1e-6, abs=1e-9)


def assert_tangent(term: Term, x: np.ndarray, h: float = 1e-7) -> None:
    """Require the tangents of a term to equal differences of its force, of step ``h`` [m]."""
    way, found, ends = np.random.default_rng(2).standard_normal(x.shape), np.zeros_like(x), term.couplings()
    each = np.einsum("eij,ej->ei", term.tangents(x), way[ends].reshape(len(ends), -1))
    np.add.at(found, ends, each.reshape(*ends.shape, 3))
    high, low = (force_of(x + side * way, TermTable.of(term)) for side in (h, -h))
    np.testing.assert_allclose(found, (high - low) / (2 * h), atol=1e-6 * np.abs(found).max())

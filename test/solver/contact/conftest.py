# SPDX-License-Identifier: Apache-2.0
"""Bodies that touch something."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial

import numpy as np
import pytest

from gdfe_ros import Simulation
from gdfe_ros.solver.contact.contact_term import ContactTerm
from gdfe_ros.solver.contact.stencil import add_loads
from test.written import simulate

CUBE = """
mesh: {bar: {size: [0.1, 0.1, 0.1], cells: [4, 4, 4]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.45, density: 1000}}
handles: {top: {where: {face: z+}}}
obstacles: {ball: {sphere: {radius: 0.04}, at: [0.05, 0, -0.09]}}
solver: {tolerance: 1.0e-5}
"""
SLIDER = """
mesh: {bar: {size: [0.1, 0.1, 0.04], cells: [3, 3, 2]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.45, density: 1000}}
handles: {}
obstacles: {floor: {plane: [0, 0, 1], at: [0, 0, -0.02], fixed: true}}
dynamics: {scheme: bdf2, step: 0.005, damping: {viscosity: 500}}
"""


@pytest.fixture
def cube() -> Callable[..., Simulation]:
    """Give a function that makes a cube above a ball, held at its top; keyword arguments override scene keys."""
    return partial(simulate, CUBE)


@pytest.fixture
def slider() -> Callable[..., Simulation]:
    """Give a function that makes a free slab on a floor, with dynamics; keyword arguments override scene keys."""
    return partial(simulate, SLIDER)


def places_at(term: ContactTerm, x: np.ndarray) -> np.ndarray:
    """Return gaps and slips (k, 3) [m] of the near points at positions (n, 3) [m]."""
    term.look(x)
    return term.stencils.places.copy()


@pytest.fixture
def virtual_work() -> Callable[..., np.ndarray]:
    """Give a function that compares the forces of a contact with its gaps and slips, and returns their gradient (n, 3).

    In a virtual displacement, the forces do the work sum l dg - t . ds. Its arguments are the term, positions (n, 3)
    [m], and virtual displacements (n, 3).
    """

    def compare(term: ContactTerm, x: np.ndarray, ways: Iterable[np.ndarray]) -> np.ndarray:
        slopes = np.zeros_like(x)
        term.look(x)
        held = term.stencils.held.copy()
        add_loads(term.stencils, slopes)
        slopes *= -1.0
        for way in ways:
            places = [places_at(term, x + sign * 1e-7 * way) for sign in (1, -1)]
            work = (held * (places[0] - places[1])).sum() / 2e-7
            size = np.linalg.norm(slopes) * np.linalg.norm(way)
            assert (slopes * way).sum() == pytest.approx(work, abs=3e-4 * size)  # tangents turn
        return slopes

    return compare

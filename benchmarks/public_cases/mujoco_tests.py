# SPDX-License-Identifier: Apache-2.0
"""The tests of MuJoCo's flex and cable (github.com/google-deepmind/mujoco) that apply to solids, by their rules."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.public_cases import Row, rows_of, simulate, solve
from gdfe_ros.results.element_fields import corner_forces, strain_energies, volume_pressures
from gdfe_ros.solver.body import Body

STRAIN = 1e-4
"""Strain s of the uniformly scaled cube: the laws agree for small strains only."""
MOMENT = 2.0 * np.pi * 1e9 * 0.01**4 / 12.0
"""Moment 2 pi E I / L [N m] that bends the rolled beam into a circle."""


def mujoco_rows() -> list[Row]:
    """Return a row for each test."""
    rest = simulate("block").stepper.body
    undeformed, turned, poked = largest(vertex_forces(rest, rest.rest)), turn_block(), turn_poke()
    cube = make_block([7.0, 7.0, 7.0], [7, 7, 7], 2.0, 0.0)
    density = strain_energies(cube, cube.rest * (1.0 + STRAIN)) / cube.shape.volume
    wrong = float((density / (3.0 * STRAIN**2) - 1.0).max())
    rolled = solve(simulate("rolled_beam"), 18)
    thin = {"mesh__bar__size": [1.0, 0.005, 0.005], "mesh__bar__cells": [280, 2, 1], "solver": {"tolerance": 1e-9}}
    gap, thin_gap = (
        float(np.linalg.norm(each.probe_positions()["end"]))
        for each in (rolled, solve(simulate("rolled_beam", **thin), 18))
    )
    moment = abs(float(rolled.result.reactions["end"][4]))
    return rows_of(
        {
            "undeformed": (undeformed, f"{undeformed:.1e} N"),
            "turned": (turned, f"{turned:.1e} N"),
            "poked": (poked, f"{poked:.1e} N"),
            "scaled": (abs(wrong), f"3 s^2 (1 + {wrong / STRAIN:.2f} s)"),
            "rolled": (gap, f"{gap:.1e} m"),
            "rolled thin": (thin_gap, f"{thin_gap:.1e} m"),
            "moment": (abs(moment / MOMENT - 1.0), f"{moment:.4f} N m ({100.0 * (moment / MOMENT - 1.0):+.3f} %)"),
        }
    )


def vertex_forces(body: Body, positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the forces (n, 3) [N] with which the strained cells act against their vertices at positions (n, 3) [m]."""
    place = np.ascontiguousarray(positions)
    found = np.zeros_like(place)
    np.add.at(found, body.cells, corner_forces(body, place, volume_pressures(body, place))[0])
    return found


def make_block(size: list[float], cells: list[int], young: float, poisson: float) -> Body:
    """Return a block of a size [m] and numbers of cells, with a modulus [Pa]."""
    material = {"law": "linear", "young": young, "poisson": poisson}
    given = {"mesh__bar__size": size, "mesh__bar__cells": cells, "materials__soft": material}
    return simulate("block", **given).stepper.body


def largest(forces: NDArray[np.float64]) -> float:
    """Return the largest magnitude of a component."""
    return float(np.abs(forces).max())


def turn_block() -> float:
    """Return the largest force [N] in a block that is turned rigidly by 45 degrees."""
    body = make_block([0.175, 0.05, 0.275], [6, 1, 6], 1e5, 0.3)
    turn = Rotation.from_rotvec(np.deg2rad(45.0) / np.sqrt(3.0) * np.ones(3))
    return largest(vertex_forces(body, turn.apply(body.rest)))


def turn_poke() -> float:
    """Return the largest difference of the forces [N] of a poked cube in two frames."""
    body = make_block([0.1, 0.1, 0.1], [2, 2, 2], 1e4, 0.1)
    poked = body.rest.copy()
    poked[0, 0] += 1e-6
    turn = Rotation.from_rotvec([0.0, np.pi / 2.0, 0.0])
    return largest(vertex_forces(body, turn.apply(poked)) - turn.apply(vertex_forces(body, poked)))

# SPDX-License-Identifier: Apache-2.0
"""The tests of MuJoCo's flex and cable (github.com/google-deepmind/mujoco) that apply to solids, by their rules."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.public_cases import Row, simulate, solve
from gdfe_ros.element_fields import corner_forces, strain_energies, volume_pressures
from gdfe_ros.solver.body import Body

FLEX, CABLE = "test/engine/engine_passive_test.cc", "test/plugin/elasticity/elasticity_test.cc"
SINGLE = float(np.finfo(np.float32).eps)
"""Precision of single numbers, the bound of several of MuJoCo's tests."""
STRAIN = 1e-4
"""Strain s of the uniformly scaled cube: the laws agree for small strains only."""
MOMENT = 2.0 * np.pi * 1e9 * 0.01**4 / 12.0
"""Moment 2 pi E I / L [N m] that bends the rolled beam into a circle."""


def mujoco_rows() -> list[Row]:
    """Return a row for each test."""
    return [_undeformed(), _turned(), _poked(), _scaled(), *_rolled()]


def vertex_forces(body: Body, positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the forces (n, 3) [N] with which the strained cells act against their vertices at positions (n, 3) [m]."""
    place = np.ascontiguousarray(positions)
    found = np.zeros_like(place)
    np.add.at(found, body.cells, corner_forces(body, place, volume_pressures(body, place))[0])
    return found


def _block(size: list[float], cells: list[int], young: float, poisson: float) -> Body:
    material = {"law": "linear", "young": young, "poisson": poisson}
    given = {"mesh__bar__size": size, "mesh__bar__cells": cells, "materials__soft": material}
    return simulate("block", **given).stepper.body


def _undeformed() -> Row:
    body = simulate("block").stepper.body
    force = float(np.abs(vertex_forces(body, body.rest)).max())
    return Row(
        source="MuJoCo, ShellModeZeroForceAtRest",
        path=FLEX,
        body="an undeformed block, 7 x 7 x 7 cells",
        rule="no force above 1e-10 N",
        figure=f"{force:.1e} N",
        value=force,
        bound=1e-10,
    )


def _turned() -> Row:
    body = _block([0.175, 0.05, 0.275], [6, 1, 6], 1e5, 0.3)
    turn = Rotation.from_rotvec(np.deg2rad(45.0) / np.sqrt(3.0) * np.ones(3))
    force = float(np.abs(vertex_forces(body, turn.apply(body.rest))).max())
    return Row(
        source="MuJoCo, InterpBendingRigidRotationInvariance",
        path=FLEX,
        body="a block turned rigidly by 45 degrees about (1, 1, 1)",
        rule="no force above 1e-6 N",
        figure=f"{force:.1e} N",
        value=force,
        bound=1e-6,
    )


def _poked() -> Row:
    body = _block([0.1, 0.1, 0.1], [2, 2, 2], 1e4, 0.1)
    poked = body.rest.copy()
    poked[0, 0] += 1e-6
    turn = Rotation.from_rotvec([0.0, np.pi / 2.0, 0.0])
    difference = vertex_forces(body, turn.apply(poked)) - turn.apply(vertex_forces(body, poked))
    return Row(
        source="MuJoCo, TrilinearParentBodyRotation",
        path=FLEX,
        body="a vertex of a cube of 0.1 m is moved by 1 um, in a frame turned by 90 degrees",
        rule="forces differ by less than 1e-12 N between the frames",
        figure=f"{np.abs(difference).max():.1e} N",
        value=float(np.abs(difference).max()),
        bound=1e-12,
    )


def _scaled() -> Row:
    body = _block([7.0, 7.0, 7.0], [7, 7, 7], 2.0, 0.0)
    density = strain_energies(body, body.rest * (1.0 + STRAIN)) / body.shape.volume
    wrong = float((density / (3.0 * STRAIN**2) - 1.0).max())
    return Row(
        source="MuJoCo, ElasticEnergySolid",
        path=FLEX,
        body=f"a cube with E = 2 and nu = 0 is scaled by 1 + s, here with s = {STRAIN:g}",
        rule=f"energy per volume 3 s^2, within {SINGLE:.1e}",
        figure=f"3 s^2 (1 + {wrong / STRAIN:.2f} s)",
        value=abs(wrong),
        bound=SINGLE,
    )


def _rolled() -> list[Row]:
    simulation = solve(simulate("rolled_beam"), 18)
    thin = {"mesh__bar__size": [1.0, 0.005, 0.005], "mesh__bar__cells": [280, 2, 1], "solver": {"tolerance": 1e-9}}
    gap, thin_gap = (
        float(np.linalg.norm(each.probe_positions()["end"]))
        for each in (simulation, solve(simulate("rolled_beam", **thin), 18))
    )
    moment = abs(float(simulation.result.reactions["end"][4]))
    given = {"source": "MuJoCo, CantileverIntoCircle", "path": CABLE}
    body = "a beam of 1 m, 10 mm thick, is bent by a moment at its end until it is a circle, 160 cells"
    return [
        Row(
            **given,
            body=body,
            rule=f"the end meets the start within {SINGLE:.1e} m",
            figure=f"{gap:.1e} m",
            value=gap,
            bound=SINGLE,
        ),
        Row(
            **given,
            body="a beam half as thick, 280 cells",
            rule=f"the end meets the start within {SINGLE:.1e} m",
            figure=f"{thin_gap:.1e} m",
            value=thin_gap,
            bound=SINGLE,
        ),
        Row(
            **given,
            body="the first of these beams",
            rule=f"the moment for it is 2 pi E I / L = {MOMENT:.4f} N m (they apply it; within 0.1 % is our bound)",
            figure=f"{moment:.4f} N m ({100.0 * (moment / MOMENT - 1.0):+.3f} %)",
            value=abs(moment / MOMENT - 1.0),
            bound=1e-3,
        ),
    ]

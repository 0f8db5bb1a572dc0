# SPDX-License-Identifier: Apache-2.0
"""Steps far from the last equilibrium: a step reported as converged is within the tolerance."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from benchmarks.torture.honesty import STREAMS, TRUTHS, error_of, played
from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.results.step_result import StepResult
from test.written import scene_of

TEXT = """\
mesh: {{bar: {{size: {size}, cells: {cells}}}}}
materials: {{rubber: {{law: neo_hookean, young: 1.0e5, poisson: 0.45}}}}
handles: {{base: {{where: {{face: x-}}, fixed: true}}, tip: {{where: {{face: x+}}}}}}
solver: {{tolerance: {tolerance}, torsion: {torsion}}}
"""
SAGGING = """\
mesh: {{bar: {{size: [0.029, 0.01, 0.01], cells: [5, 2, 2]}}}}
materials: {{rubber: {{law: neo_hookean, young: 1.0e5, poisson: 0.49, density: 1000}}}}
handles: {{base: {{where: {{face: x-}}, fixed: true}}}}
loads: {{weight: {{gravity: [0, 0, -85]}}}}
solver: {{tolerance: {tolerance}}}
"""


def _led(poses: list[Any], **keys: Any) -> StepResult:
    simulation = Simulation(scene_of(TEXT.format(**keys)))
    return [simulation.step(Command(handles={"tip": Pose(*pose)})) for pose in poses][-1]


def _turned(angle: float) -> list[Any]:
    return [((0.0, 0.0, 0.0), (np.radians(angle), 0.0, 0.0))]


def _bent(length: float) -> list[Any]:
    """Return two poses, shift [m] and rotation vector [rad], that shorten, lift and turn a bar."""
    ways = ((-0.05, 0.0, 0.2), (90.0, 20.0, 0.0)), ((-0.1, 0.1, 0.3), (180.0, 20.0, 0.0))
    return [(tuple(length * np.array(shift)), tuple(np.radians(turn))) for shift, turn in ways]


@pytest.mark.parametrize(
    ("length", "cells", "poses", "tolerance", "torsion"),
    [
        (0.14, [56, 4, 4], _turned(60.0), 1e-5, "section"),
        (0.10, [30, 3, 3], _turned(90.0), 1e-4, "section"),
        (0.14, [42, 3, 3], _turned(90.0), 1e-4, "cell"),
        (0.25, [50, 2, 2], _bent(0.25), 1e-3, "section"),
        (0.12, [36, 3, 3], _bent(0.12), 1e-3, "cell"),
    ],
)
def test_a_bar_held_at_both_ends_is_as_near_as_it_says(
    length: float, cells: list[int], poses: list[Any], tolerance: float, torsion: str
) -> None:
    """A bar bent far in one or two steps is within the tolerance of a solution with a tolerance of 1e-8."""
    keys = {"size": [length, 0.01, 0.01], "cells": cells, "torsion": torsion}
    loose, exact = (_led(poses, **keys, tolerance=value) for value in (tolerance, 1e-8))
    assert loose.converged
    assert exact.converged
    assert np.linalg.norm(loose.positions - exact.positions, axis=1).max() < tolerance * length


@pytest.mark.parametrize("name", ["tendon bar 1:40, one cell across", "tendon bar 1:20, nu 0.499"])
def test_a_slender_bar_bent_by_a_tendon_is_within_the_tolerance(name: str) -> None:
    """Hourglass scales and volumes of a slender bar settle so far that its bent shape is within the tolerance."""
    stream, size = STREAMS[name], STREAMS[name].scene().mesh.size
    for found, true in zip(played(stream, 1e-4), played(stream, TRUTHS[0]), strict=True):
        assert found.converged
        assert true.converged
        assert error_of(found, true, size) < 1e-4


def test_a_cold_step_of_a_nearly_incompressible_bar_is_within_the_tolerance() -> None:
    """The last pressures of a thick bar under its weight move it, and the solve does not end before that."""

    def sagged(tolerance: float) -> StepResult:
        return Simulation(scene_of(SAGGING.format(tolerance=tolerance))).step(Command(loads={"weight": 1.0}))

    loose, exact = sagged(1e-3), sagged(1e-8)
    assert loose.converged
    assert exact.converged
    assert np.linalg.norm(loose.positions - exact.positions, axis=1).max() < 1e-3 * 0.029

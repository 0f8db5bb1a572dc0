# SPDX-License-Identifier: Apache-2.0
"""Where a step starts: extrapolation of smooth motion, the harmonic predictor for the rest."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from gdfe_ros.constraints import Handle
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.mesh.operators import shape_operators
from gdfe_ros.solver.global_matrix import GlobalMatrix, assemble_centring
from gdfe_ros.solver.predictor import Predictor
from gdfe_ros.solver.scope import Movable
from gdfe_ros.solver.unknowns import Unknowns, number_unknowns

End = Callable[[HexMesh, str], NDArray[np.int32]]
MESH = bar([0.4, 0.1, 0.1], [4, 1, 1])
REST = MESH.vertices
NO_COMMANDS = np.zeros(0)


@pytest.fixture
def unknowns(end: End) -> Unknowns:
    """Hold a bar at both ends."""
    handles = [Handle("base", end(MESH, "x-"), fixed=True), Handle("tip", end(MESH, "x+"))]
    return number_unknowns(MESH.n_vertices, MESH.cells, handles)


@pytest.fixture
def predictor(unknowns: Unknowns) -> Predictor:
    """Make a predictor that remembers nothing yet."""
    return Predictor(unknowns)


@pytest.fixture
def movable(unknowns: Unknowns) -> Movable:
    """Let every free vertex move."""
    matrix = assemble_centring(shape_operators(MESH.vertices, MESH.cells))
    return Movable.all_of(unknowns, GlobalMatrix(matrix, unknowns))


def lifted(amount: float, axis: int = 2) -> NDArray[np.float64]:
    """Return the plates' positions with the tip moved along an axis."""
    base = REST.copy()
    base[REST[:, 0] == 0.4, axis] += amount
    return base


def bent(amount: float) -> NDArray[np.float64]:
    """Return a state that fits ``lifted``, but is not the harmonic one."""
    x = REST.copy()
    x[:, 2] += amount * (x[:, 0] / 0.4) ** 3
    x[:, 1] += 0.3 * amount * x[:, 0] * (0.4 - x[:, 0])
    return x


def test_first_step_spreads_the_plates_motion(predictor: Predictor, movable: Movable, unknowns: Unknowns) -> None:
    """Lift the tip from rest: every free vertex rises by something between the plates' motions."""
    found = predictor.predict(REST, REST, lifted(0.1), NO_COMMANDS, movable)
    assert found.ratio == 0.0
    rise = (found.positions - REST)[unknowns.free, 2]
    assert ((rise > 0.0) & (rise < 0.1)).all()


@pytest.mark.parametrize("ratio", [0.25, 1.0, 1.5])
def test_repeated_motion_is_extrapolated(
    predictor: Predictor, movable: Movable, unknowns: Unknowns, ratio: float
) -> None:
    """Go on in the same direction: the last change of the state is repeated in proportion."""
    predictor.remember(REST, bent(0.1), REST, lifted(0.1), NO_COMMANDS)
    found = predictor.predict(bent(0.1), lifted(0.1), lifted(0.1 * (1.0 + ratio)), NO_COMMANDS, movable)
    assert found.ratio == pytest.approx(ratio)
    expected = bent(0.1) + ratio * (bent(0.1) - REST)
    np.testing.assert_allclose(found.positions[unknowns.free], expected[unknowns.free], atol=1e-12)


@pytest.mark.parametrize(
    "base", [lifted(0.0), lifted(0.1) + lifted(0.1, axis=1) - REST, lifted(0.5)], ids=["back", "aside", "leap"]
)
def test_other_motion_is_not_extrapolated(
    predictor: Predictor, movable: Movable, unknowns: Unknowns, base: NDArray[np.float64]
) -> None:
    """Turn back, turn aside or leap: the present state plus the harmonic spread of the motion."""
    predictor.remember(REST, bent(0.1), REST, lifted(0.1), NO_COMMANDS)
    found = predictor.predict(bent(0.1), lifted(0.1), base, NO_COMMANDS, movable)
    fresh = predictor.predict(REST, lifted(0.1), base, NO_COMMANDS, movable)
    assert found.ratio == 0.0
    np.testing.assert_allclose(found.positions - bent(0.1), fresh.positions - REST, atol=1e-12)


def test_nothing_moves_where_no_plate_moves(predictor: Predictor, movable: Movable) -> None:
    """Command the same poses again: the state stays, bit by bit."""
    predictor.remember(REST, bent(0.1), REST, lifted(0.1), NO_COMMANDS)
    found = predictor.predict(bent(0.1), lifted(0.1), lifted(0.1), NO_COMMANDS, movable)
    assert found.ratio == 0.0
    np.testing.assert_array_equal(found.positions, bent(0.1))


def test_reset_forgets_the_motion(predictor: Predictor, movable: Movable) -> None:
    """Reset between two steps: no extrapolation."""
    predictor.remember(REST, bent(0.1), REST, lifted(0.1), NO_COMMANDS)
    predictor.reset()
    assert predictor.predict(bent(0.1), lifted(0.1), lifted(0.2), NO_COMMANDS, movable).ratio == 0.0


def test_commands_count_like_plates(predictor: Predictor, movable: Movable) -> None:
    """Ramp a tension without moving a plate: extrapolated; reverse it: not."""
    predictor.remember(REST, bent(0.1), REST, REST, np.array([2.0]))
    on = predictor.predict(bent(0.1), REST, REST, np.array([2.0]), movable)
    assert on.ratio == pytest.approx(1.0)
    np.testing.assert_allclose(on.positions, bent(0.2), atol=1e-12)
    back = predictor.predict(bent(0.1), REST, REST, np.array([-2.0]), movable)
    assert back.ratio == 0.0
    np.testing.assert_array_equal(back.positions, bent(0.1))

# SPDX-License-Identifier: Apache-2.0
"""The start of a step: extrapolation of smooth motion, otherwise the harmonic predictor."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints import Handle
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.paper.relative import assemble_centring
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.equilibrium.energy import EquilibriumSolver
from gdfe_ros.solver.equilibrium.predictor import Predictor, find_screw, follow_screws
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.matrix.unknowns import Unknowns
from gdfe_ros.solver.state import State

End = Callable[[HexMesh, str], NDArray[np.int32]]
MESH = bar([0.4, 0.1, 0.1], [4, 1, 1])
REST = MESH.vertices
NO_COMMANDS = np.zeros(0)


@pytest.fixture
def body(make_body: Callable[..., Body], end: End) -> Body:
    """Return a bar held at both ends."""
    return make_body(MESH, None, [Handle("base", end(MESH, "x-"), fixed=True), Handle("tip", end(MESH, "x+"))])


@pytest.fixture
def unknowns(body: Body) -> Unknowns:
    """Give the bar's numbering."""
    return body.unknowns


@pytest.fixture
def predictor(body: Body) -> Predictor:
    """Make a predictor of the bar."""
    matrix = ConstantMatrix(assemble_centring(body.shape), body.rest, body.unknowns)
    return Predictor(body, HandleMotions(body), matrix)


@pytest.fixture
def rest(body: Body) -> State:
    """Give the undeformed state."""
    return EquilibriumSolver(body).at_rest()


@pytest.fixture
def moved(rest: State, predictor: Predictor) -> State:
    """Return the state after the tip was lifted."""
    return after(rest, predictor, bent(0.1), lifted(0.1), NO_COMMANDS)


def after(
    state: State,
    predictor: Predictor,
    positions: NDArray[np.float64],
    base: NDArray[np.float64],
    change: NDArray[np.float64],
) -> State:
    """Return the state after a step to ``positions``, with the handles at ``base`` and a change of the commands."""
    found = state.with_(positions=positions, base=base)
    return found.with_(motion=predictor.motion(state, found, change))


def lifted(amount: float, axis: int = 2) -> NDArray[np.float64]:
    """Return the handles' positions after the tip has moved along an axis."""
    base = REST.copy()
    base[REST[:, 0] == 0.4, axis] += amount
    return base


def bent(amount: float) -> NDArray[np.float64]:
    """Return positions that fit ``lifted`` at the handles, but not the harmonic interpolation."""
    x = REST.copy()
    x[:, 2] += amount * (x[:, 0] / 0.4) ** 3
    x[:, 1] += 0.3 * amount * x[:, 0] * (0.4 - x[:, 0])
    return x


@pytest.mark.parametrize("angle", [2.0, np.pi])
def test_handles_that_turn_together_turn_the_body(predictor: Predictor, rest: State, angle: float) -> None:
    """A motion that is common to all handles moves the body rigidly, also where rounding decides its sense."""
    for axis in np.random.default_rng(0).normal(size=(8, 3)):
        goal = Rotation.from_rotvec(angle / np.linalg.norm(axis) * axis).apply(REST)
        assert predictor.predict(rest, goal, NO_COMMANDS).state.positions == pytest.approx(goal, abs=1e-12)


@pytest.mark.parametrize("ratio", [0.25, 1.0, 1.5])
def test_repeated_motion_is_extrapolated(predictor: Predictor, unknowns: Unknowns, moved: State, ratio: float) -> None:
    """For a motion in the same direction, the last change of the positions is extrapolated in proportion."""
    found = predictor.predict(moved, lifted(0.1 * (1.0 + ratio)), NO_COMMANDS)
    assert found.ratio == pytest.approx(ratio)
    expected = bent(0.1) + ratio * (bent(0.1) - REST)
    np.testing.assert_allclose(found.state.positions[unknowns.free], expected[unknowns.free], atol=1e-12)


@pytest.mark.parametrize(
    "base", [lifted(0.0), lifted(0.1) + lifted(0.1, axis=1) - REST, lifted(0.5)], ids=["back", "aside", "leap"]
)
def test_other_motion_is_not_extrapolated(
    predictor: Predictor, rest: State, moved: State, base: NDArray[np.float64]
) -> None:
    """For a reversed, sideways or much larger motion, the harmonic motion is added to the present positions."""
    found = predictor.predict(moved, base, NO_COMMANDS)
    fresh = predictor.predict(rest.with_(base=lifted(0.1)), base, NO_COMMANDS)
    assert found.ratio == 0.0
    np.testing.assert_allclose(found.state.positions - bent(0.1), fresh.state.positions - REST, atol=1e-12)


@pytest.mark.exact("an exact ratio without a shift")
def test_commands_count_like_handles(predictor: Predictor, rest: State) -> None:
    """A tension that increases steadily without a handle's motion is extrapolated, a reversed one is not."""
    pulled = after(rest, predictor, bent(0.1), REST, np.array([2.0]))
    on = predictor.predict(pulled, REST, np.array([2.0]))
    assert on.ratio == pytest.approx(1.0)
    np.testing.assert_allclose(on.state.positions, bent(0.2), atol=1e-12)
    back = predictor.predict(pulled, REST, np.array([-2.0]))
    assert back.ratio == 0.0
    np.testing.assert_array_equal(back.state.positions, bent(0.1))


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (1e-5, 0.0, 2e-5), (0.3, -1.0, 2.0), (0.0, np.pi - 1e-3, 0.0)])
def test_a_screw_follows_its_rigid_motion(turn: tuple[float, float, float]) -> None:
    """Its end is the motion's end, and twice its half is the whole."""
    moved = Rotation.from_rotvec(turn).apply(REST) + np.array([0.5, -0.2, 0.1])
    screws = np.tile(find_screw(REST, moved, np.zeros(3)), (len(REST), 1))
    assert follow_screws(screws, REST) == pytest.approx(moved, abs=1e-12)
    assert follow_screws(0.5 * screws, follow_screws(0.5 * screws, REST)) == pytest.approx(moved, abs=1e-12)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_points_on_a_line_only_translate(count: int) -> None:
    """Their rotation about the line is not known."""
    line = np.outer(np.linspace(0.0, 1.0, count), [1.0, 2.0, 0.0])
    moved = Rotation.from_rotvec([0.0, 0.0, 1.0]).apply(line) + 1.0
    assert find_screw(line, moved, np.zeros(3)) == pytest.approx([0.0, 0.0, 0.0, *(moved - line).mean(axis=0)])

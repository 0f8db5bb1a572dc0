# SPDX-License-Identifier: Apache-2.0
"""Newton steps by conjugate gradients: exact, with a true error estimate, and stopped at negative curvature."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import eigvalsh_tridiagonal
from scipy.spatial.transform import Rotation

from gdfe_ros import Simulation
from gdfe_ros.scene import scene_from_text
from gdfe_ros.solver.descent import newton
from gdfe_ros.solver.descent.minimiser import Task
from gdfe_ros.solver.descent.newton import StepKind
from gdfe_ros.solver.descent.products import TangentProducts
from gdfe_ros.solver.descent.workspace import allocate
from gdfe_ros.solver.distance import largest
from gdfe_ros.solver.equilibrium.solve import Solve
from gdfe_ros.solver.tangent.level import TangentLevel

STRIP = """
name: strip
mesh: {bar: {size: [0.1, 0.01, 0.01], cells: [10, 2, 2]}}
materials: {m: {law: neo_hookean, young: 1.0e6, poisson: 0.45, density: 1000}}
regions: [{material: m}]
handles: {base: {where: {face: x-}, fixed: true}}
loads: {weight: {gravity: [0, 0, -1.0]}}
"""


@dataclass
class Strip:
    """A clamped strip in a deformed shape, with a stored tangent taken in the undeformed shape."""

    task: Task
    level: TangentLevel
    gradient: NDArray[np.float64]
    now: NDArray[np.float64]

    @classmethod
    def moved(cls, stretch: float) -> Strip:
        """Return a strip stretched by a fraction of its length after the tangent of its undeformed shape was stored."""
        simulation = Simulation(scene_from_text(STRIP))
        equilibrium = simulation.stepper.equilibrium
        body, state = equilibrium.body, equilibrium.at_rest()
        level = TangentLevel(body, equilibrium.matrix.assembled)
        tasks = []
        for share in (0.0, stretch):
            x = body.rest * (1.0 + share, 1.0, 1.0)
            x[body.unknowns.prescribed] = body.rest[body.unknowns.prescribed]
            solve = Solve.at(equilibrium.model, state.with_(positions=x))
            tasks.append(solve.evaluate(equilibrium.whole, equilibrium.matrix.coupling, threads=None))
            work = tasks[-1].active.workspace
            if share == 0.0:
                level.take(tasks[-1].problem, work.u, work.x)
        products = TangentProducts(body)
        products.begin(tasks[-1])
        now = np.stack([products(column) for column in np.eye(len(work.u))])
        return cls(tasks[-1], level, work.gradient.copy(), 0.5 * (now + now.T))

    def solved(
        self, right: NDArray[np.float64], target: float, motion: NDArray[np.float64] | None = None
    ) -> tuple[StepKind, newton.Krylov]:
        """Solve the present tangent for a right-hand side; ``motion`` is the change since the last equilibrium."""
        work = self.task.active.workspace
        rows, cells = len(work.u) // 3, (40, 8)
        krylov, beside = newton.allocate_krylov(rows, cells), allocate(rows, work.x, cells, memory=0)
        krylov.course[0].least = 1.0
        krylov.residual[...] = right
        krylov.motion[...] = 0.0 if motion is None else motion
        self.level.solve(right, krylov.z)
        solved, _ = newton.solve_newton(self.task.problem, work, beside, self.level.kept, krylov, 1e-8, target, np.inf)
        return StepKind(solved), krylov


@pytest.mark.parametrize("stretch", [0.01, 0.05])
def test_what_is_left_of_a_step_is_told(stretch: float) -> None:
    """With the undeformed tangent as preconditioner, the step's error is at most twice the reported error."""
    strip = Strip.moved(stretch)
    right = np.random.default_rng(0).standard_normal(len(strip.gradient))
    solved, krylov = strip.solved(right, 0.0)
    exact = np.linalg.solve(strip.now, right)
    assert solved is StepKind.FOUND
    left = float(krylov.course[0].distance) - largest(krylov.step)
    assert 0.0 < largest(krylov.step - exact) <= 2.0 * left
    assert left < 2.0 * newton.FORCING * largest(exact)


def test_the_least_ritz_value_is_that_of_the_pencil() -> None:
    """At 5 % stretch, the least Ritz value is at most 1.25 times the least eigenvalue of the preconditioned tangent."""
    strip = Strip.moved(0.05)
    _, krylov = strip.solved(np.random.default_rng(1).standard_normal(len(strip.gradient)), 0.0)
    taken = strip.level.assembled(strip.level._loaded).toarray()
    least = np.linalg.eigvals(np.linalg.solve(taken, strip.now)).real.min()
    assert least * 0.999 <= float(krylov.course[0].least) <= 1.25 * min(least, 1.0)


def test_a_step_along_the_motion_is_found_at_once() -> None:
    """With a loose target, a step along the softest mode is accurate only if the given motion is along that mode."""
    strip = Strip.moved(0.05)
    _, vectors = np.linalg.eigh(strip.now)
    soft = 1e-3 * vectors[:, 0] / largest(vectors[:, 0])
    errors = [largest(strip.solved(strip.now @ soft, 1.0, motion)[1].step - soft) for motion in (3.0 * soft, None)]
    assert errors[0] < 1e-4 * largest(soft)
    assert errors[1] > 1e-2 * largest(soft)


def test_negative_curvature_is_told() -> None:
    """In a strip squashed far beyond its buckling load, a direction of negative curvature is found."""
    strip = Strip.moved(-0.2)
    values, vectors = np.linalg.eigh(strip.now)
    assert values[0] < 0.0
    solved, krylov = strip.solved(vectors[:, 0] + 0.01 * vectors[:, -1], 0.0)
    assert solved is StepKind.CURVED
    assert float(krylov.course[0].distance) == np.inf
    assert krylov.direction @ strip.now @ krylov.direction < 0.0


def test_ritz_values_are_those_of_a_library() -> None:
    """The bisection gives LAPACK's eigenvalues of tridiagonal matrices over twelve decades."""
    random = np.random.default_rng(3)
    for count in (1, 2, 5, 40):
        root = np.diag(10.0 ** random.uniform(-6.0, 0.0, count)) + np.diag(random.uniform(0.0, 0.1, count - 1), 1)
        whole = root.T @ root
        diagonal, beside = np.diag(whole).copy(), np.append(np.diag(whole, 1), 0.0)
        found = newton.least_ritz.py_func(diagonal, beside, count)
        expected = eigvalsh_tridiagonal(diagonal, beside[: count - 1])[0] if count > 1 else diagonal[0]
        assert found == pytest.approx(expected, rel=1e-6, abs=1e-14)


def test_a_factor_follows_a_rotation() -> None:
    """Under a rotation of the strip by a radian, the rotated stored tangent equals the tangent taken in that pose."""
    simulation = Simulation(scene_from_text(STRIP.replace(", fixed: true", "")))
    equilibrium = simulation.stepper.equilibrium
    body, state = equilibrium.body, equilibrium.at_rest()
    turned = np.ascontiguousarray(body.rest @ Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix().T)
    first, second = (TangentLevel(body, equilibrium.matrix.assembled) for _ in range(2))
    for level, x in ((first, body.rest), (second, turned)):
        solve = Solve.at(equilibrium.model, state.with_(positions=x, base=x))
        task = solve.evaluate(equilibrium.whole, equilibrium.matrix.coupling, threads=None)
        level.take(task.problem, task.active.workspace.u, x)
    right = np.random.default_rng(4).standard_normal(3 * len(body.unknowns.free))
    answers = np.empty((3, len(right)))
    first.solve(right, answers[0])
    first.turn(turned)
    first.solve(right, answers[1])
    second.solve(right, answers[2])
    np.testing.assert_allclose(answers[1], answers[2], atol=1e-6 * np.abs(answers[2]).max())
    assert np.abs(answers[0] - answers[2]).max() > 0.1 * np.abs(answers[2]).max()

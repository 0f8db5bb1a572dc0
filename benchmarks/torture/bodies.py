# SPDX-License-Identifier: Apache-2.0
"""Bodies, materials and the simulation driver of the torture test."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators import Actuator, Load
from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.materials import Law, Linear, Material, NeoHookean, preset
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.solver.settings import Policy, SolverSettings

LAWS: dict[str, Material] = {
    "linear": Linear(young=1e5, poisson=0.3),
    "neo-hookean": NeoHookean(young=1e5, poisson=0.45),
    "ogden": preset("ninjaflex", law=Law.OGDEN, poisson=0.4),
    "curve": preset("cheetah", law=Law.CURVE, poisson=0.45),
    "linear, nu 0.499": Linear(young=1e5, poisson=0.499),
    "neo-hookean, nu 0.495": NeoHookean(young=1e5, poisson=0.495),
    "ogden, nu 0.495": preset("cheetah", law=Law.OGDEN, poisson=0.495),
    "curve, nu 0.495": preset("ninjaflex", law=Law.CURVE, poisson=0.495),
}
"""Laws of the test. Each law occurs twice: compressible, and nearly incompressible with pressures as unknowns."""
COMPRESSIBLE = tuple(LAWS)[:4]
SHAPES = ("linear", "curve")
"""Laws with which the ``relative`` policy is tested; this policy depends only on shapes and moduli."""
BAR = bar([0.4, 0.1, 0.1], [8, 2, 2])
"""A bar that is small enough for the explicit inverse."""
CUBE = bar([0.1, 0.1, 0.1], [4, 4, 4])


def laws_for(policy: Policy, *, compressible: bool = False) -> tuple[str, ...]:
    """Return the names of the laws that apply to a policy."""
    if policy is Policy.RELATIVE:
        return SHAPES
    return COMPRESSIBLE if compressible else tuple(LAWS)


def face(mesh: HexMesh, side: str) -> NDArray[np.int32]:
    """Return the vertices of a face of a bar; ``side`` is 'x-' or 'x+'."""
    x = mesh.vertices[:, 0]
    end = x.min() if side == "x-" else x.max()
    return np.flatnonzero(np.abs(x - end) <= 1e-9 * mesh.size).astype(np.int32)


def make_scene(
    mesh: HexMesh,
    material: Material | Sequence[Material],
    *,
    policy: Policy,
    tolerance: float = 1e-6,
    cell_material: NDArray[np.int32] | None = None,
    handles: Sequence[Handle] | None = None,
    max_iterations: int = 5000,
    actuators: Sequence[Actuator] = (),
    loads: Sequence[Load] = (),
) -> Scene:
    """Return a scene with a body that is fixed at x- and has the handle `tip` at x+, unless other handles are given."""
    materials = [material] if isinstance(material, Material) else list(material)
    if handles is None:
        handles = [Handle("base", face(mesh, "x-"), fixed=True), Handle("tip", face(mesh, "x+"))]
    return Scene(
        name="torture",
        mesh=mesh,
        materials={f"m{i}": item for i, item in enumerate(materials)},
        cell_material=np.zeros(mesh.n_cells, np.int32) if cell_material is None else cell_material,
        handles=tuple(handles),
        solver=SolverSettings(policy=policy, tolerance=tolerance, max_iterations=max_iterations),
        actuators=tuple(actuators),
        loads=tuple(loads),
    )


class Driver:
    """A simulation whose results are stored, and whose energy is checked in every descent.

    Attributes:
        simulation: the simulation.
        results: results of all steps so far.
        rise: largest increase of the energy within a descent so far, divided by the magnitude of the energy's terms.
        neutral: dict from actuator or load to the command that leaves the body undeformed.
    """

    def __init__(self, scene: Scene) -> None:
        self.simulation = Simulation(scene)
        self.neutral = dict(self.simulation.commands)
        self.results: list[StepResult] = []
        self.rise = 0.0
        self.simulation.observe_energy(self._watcher())

    def _watcher(self) -> Callable[[float, float, bool], None]:
        last = [0.0]

        def watch(energy: float, scale: float, begins: bool) -> None:
            if not begins and np.isfinite(energy - last[0]):
                self.rise = max(self.rise, (energy - last[0]) / max(scale, 1e-300))
            last[0] = energy

        return watch

    def step(
        self,
        pose: Pose | None = None,
        *,
        name: str = "tip",
        actuators: Mapping[str, float] | None = None,
        loads: Mapping[str, float] | None = None,
        dt: float = 0.0,
    ) -> StepResult:
        """Make one step of ``dt`` seconds, and store and return its result."""
        handles = {} if pose is None else {name: pose}
        self.results.append(self.simulation.step(Command(handles, actuators or {}, loads or {}), dt=dt))
        return self.results[-1]

    def follow(self, pose: Pose, steps: int, *, name: str = "tip") -> StepResult:
        """Move a handle to a pose in equal steps; return the last result. The results are not stored."""
        begin = self.simulation.targets[name]
        for i in range(steps):
            result = self.simulation.step(Command({name: begin.blend(pose, (i + 1) / steps)}))
        return result


def distance(found: NDArray[np.float64], expected: NDArray[np.float64], length: float) -> float:
    """Return the largest distance of a vertex from its expected position, divided by a length."""
    return float(np.linalg.norm(found - expected, axis=1).max() / length)

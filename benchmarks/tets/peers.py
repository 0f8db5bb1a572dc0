# SPDX-License-Identifier: Apache-2.0
"""The clamped bar in Drake and Newton: linear tetrahedra, released under gravity, damped until the motion has ended."""

from __future__ import annotations

import importlib.util
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import meshio
import numpy as np

from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.tetmesh import corners_of_six

STEP, DURATION, DAMPING = 5e-3, 2.0, 0.05
"""Time step [s], simulated time [s], and stiffness damping [s]. At the end, the oscillation is below 0.1 %."""


YOUNG, DENSITY = 2e5, 1000.0
LARGEST = 100.0
"""Largest sag [mm] of a motion that does not diverge: the length of the bar."""
ITERATIONS = 10, 100
"""Numbers of iterations in a step of Newton; its sag depends on them."""


def peer_sags(grid: HexMesh, exact: dict[float, float]) -> Iterator[list[str]]:
    """Yield a row for each solver that is installed: its name, the nodes, and four columns for each Poisson's ratio.

    The columns are the sag [mm], its error [%], the iterations in a step and the time [ms]. ``exact`` are the sags
    [mm].
    """
    for name, module, steps, hung in PEERS:
        if importlib.util.find_spec(module) is None:
            continue
        row = [name, str(grid.n_vertices)]
        for poisson, wanted in exact.items():
            began = time.perf_counter()
            found = 1e3 * hung(grid, poisson)
            spent = 1e3 * (time.perf_counter() - began)
            sound = abs(found) < LARGEST
            row += [f"{found:.2f}", f"{100.0 * found / wanted - 100.0:+.1f}"] if sound else ["diverges", "-"]
            row += [steps, f"{spent:.0f}"]
        yield row


def _in_drake(grid: HexMesh, poisson: float) -> float:
    """Return the sag of the end [m] after `DURATION`, in Drake."""
    from pydrake.geometry import GeometryInstance, Mesh, ProximityProperties
    from pydrake.math import RigidTransform
    from pydrake.multibody.fem import DeformableBodyConfig, MaterialModel
    from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import DiagramBuilder

    builder = DiagramBuilder()
    given = MultibodyPlantConfig(time_step=STEP, discrete_contact_approximation="sap")
    plant, _ = AddMultibodyPlant(given, builder)
    config = DeformableBodyConfig()
    config.set_youngs_modulus(YOUNG)
    config.set_poissons_ratio(poisson)
    config.set_mass_density(DENSITY)
    config.set_material_model(MaterialModel.kNeoHookean)
    config.set_stiffness_damping_coefficient(DAMPING)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bar.vtk"
        meshio.Mesh(grid.vertices, [("tetra", corners_of_six(grid.cells))]).write(
            path, binary=False, file_format="vtk42"
        )
        shape = GeometryInstance(RigidTransform(), Mesh(str(path)), "bar")
        shape.set_proximity_properties(ProximityProperties())
        model = plant.mutable_deformable_model()
        body = model.RegisterDeformableBody(shape, config, 1.0)
    model.SetWallBoundaryCondition(body, [1e-6, 0, 0], [1, 0, 0])
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyContextFromRoot(simulator.get_mutable_context())
    rest = model.GetPositions(context, body)
    end = rest[0] > rest[0].max() - 1e-9
    simulator.AdvanceTo(DURATION)
    return float((rest - model.GetPositions(context, body))[2, end].mean())


def _in_newton(grid: HexMesh, poisson: float, *, iterations: int) -> float:
    """Return the sag of the end [m] after `DURATION`, in Newton with its solver VBD."""
    import newton
    import warp

    warp.config.quiet = True
    shear = YOUNG / 2.0 / (1.0 + poisson)
    with warp.ScopedDevice("cpu"):
        builder = newton.ModelBuilder()
        builder.add_soft_mesh(
            pos=warp.vec3(0.0, 0.0, 0.0),
            rot=warp.quat_identity(),
            scale=1.0,
            vel=warp.vec3(0.0, 0.0, 0.0),
            vertices=[warp.vec3(*point) for point in grid.vertices],
            indices=corners_of_six(grid.cells).ravel().tolist(),
            density=DENSITY,
            k_mu=shear,
            k_lambda=2.0 * shear * poisson / (1.0 - 2.0 * poisson),
            k_damp=DAMPING,
        )
        for held in np.flatnonzero(grid.vertices[:, 0] < 1e-9):
            builder.particle_mass[held] = 0.0
            builder.particle_flags[held] &= ~newton.ParticleFlags.ACTIVE
        builder.color()
        model = builder.finalize()
        solver = newton.solvers.SolverVBD(
            model, iterations=iterations, particle_enable_self_contact=False, particle_enable_tile_solve=False
        )
        now, after, control = model.state(), model.state(), model.control()
        rest = now.particle_q.numpy().copy()
        for _ in range(round(DURATION / STEP)):
            now.clear_forces()
            solver.step(now, after, control, None, STEP)
            now, after = after, now
        end = rest[:, 0] > rest[:, 0].max() - 1e-6
        return float((rest - now.particle_q.numpy())[end, 2].mean())


Hung = Callable[[HexMesh, float], float]
PEERS: tuple[tuple[str, str, str, Hung], ...] = (
    ("Drake, linear tetrahedra", "pydrake", "-", _in_drake),
    *(
        ("Newton, linear tetrahedra", "newton", str(count), partial(_in_newton, iterations=count))
        for count in ITERATIONS
    ),
)
"""Name, module, iterations in a step and function of each peer."""

# SPDX-License-Identifier: Apache-2.0
"""The clamped bar in Drake: linear tetrahedra, released under gravity and damped until the motion has ended."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import meshio

from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.tetmesh import SIX_OF_A_HEXAHEDRON

STEP, DURATION, DAMPING = 5e-3, 2.0, 0.05
"""Time step [s], simulated time [s], and stiffness damping [s]. At the end, the oscillation is below 0.1 %."""


def drake_sag(grid: HexMesh, poissons: tuple[float, ...] = (0.45, 0.4999)) -> list[str] | None:
    """Return sag [mm], error [%], iterations and time [ms] for each Poisson's ratio; None without pydrake."""
    try:
        import pydrake  # noqa: F401
    except ImportError:
        return None
    row, exact = [], {0.45: 18.0, 0.4999: 17.8}
    for poisson in poissons:
        began = time.perf_counter()
        found = 1e3 * _hung(grid, poisson)
        spent = 1e3 * (time.perf_counter() - began)
        row += [f"{found:.2f}", f"{100.0 * found / exact[poisson] - 100.0:+.1f}", "-", f"{spent:.0f}"]
    return row


def _hung(grid: HexMesh, poisson: float) -> float:
    """Return the sag of the end [m] after `DURATION`."""
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
    config.set_youngs_modulus(2e5)
    config.set_poissons_ratio(poisson)
    config.set_mass_density(1000.0)
    config.set_material_model(MaterialModel.kNeoHookean)
    config.set_stiffness_damping_coefficient(DAMPING)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bar.vtk"
        cells = grid.cells[:, SIX_OF_A_HEXAHEDRON].reshape(-1, 4)
        meshio.Mesh(grid.vertices, [("tetra", cells)]).write(path, binary=False, file_format="vtk42")
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


if __name__ == "__main__":
    from gdfe_ros.mesh import bar

    print(drake_sag(bar([0.1, 0.02, 0.02], [5, 1, 1])))

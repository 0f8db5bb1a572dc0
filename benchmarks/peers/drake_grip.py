# SPDX-License-Identifier: Apache-2.0
"""A box between two soft pads on prismatic joints in Drake: tetrahedra, semi-analytic primal contact (SAP).

The paddles have actuated prismatic joints along x. The outer faces of the pads are welded to the paddles. Each cell of
the lattice is divided into six tetrahedra. Drake's pads have the same vertices as ours.
"""

from __future__ import annotations

import tempfile
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.force_grip_case import (
    BOX,
    BOX_MASS,
    CELLS,
    DENSITY,
    GAP,
    PAD,
    PADDLE_MASS,
    POISSON,
    SQUEEZE,
    STEP,
    YOUNG,
)

_SIX = ((0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7))
"""Six tetrahedra of a cell, as indices of its corners; the bits of an index are x, y and z."""


def available() -> str:
    """Return the reason why Drake cannot be run; empty if it can."""
    return "" if find_spec("pydrake") else "not installed; remedy: pip install 'gdfe_ros[bench]'"


def simulate(friction: float, *, seconds: float) -> dict[str, float]:
    """Squeeze and hold the box; return ``sunk`` [m], ``drift`` [m/s] in the second half, and time of a ``step`` [s]."""
    from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import DiagramBuilder

    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlant(MultibodyPlantConfig(time_step=STEP, discrete_contact_approximation="sap"), builder)
    with tempfile.TemporaryDirectory() as folder:
        box = _fill(plant, friction, Path(folder))
        diagram = builder.Build()
        simulator = Simulator(diagram)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.get_actuation_input_port().FixValue(context, [SQUEEZE, SQUEEZE])
    simulator.Initialize()
    count, heights, spent = round(seconds / STEP), [], time.process_time()
    for step in range(count):
        simulator.AdvanceTo((step + 1) * STEP)
        heights.append(float(plant.EvalBodyPoseInWorld(context, box).translation()[2]))
    spent = time.process_time() - spent
    drift = (heights[-1] - heights[count // 2]) / (0.5 * seconds)
    return {"sunk": -heights[-1], "drift": abs(drift), "step": spent / count}


def _fill(plant: Any, friction: float, folder: Path) -> Any:
    """Add box, paddles and pads to the plant; return the box."""
    from pydrake.geometry import (
        AddContactMaterial,
        AddRigidHydroelasticProperties,
        Box,
        GeometryInstance,
        Mesh,
        ProximityProperties,
    )
    from pydrake.math import RigidTransform
    from pydrake.multibody.fem import DeformableBodyConfig, MaterialModel
    from pydrake.multibody.plant import CoulombFriction
    from pydrake.multibody.tree import PrismaticJoint, SpatialInertia, UnitInertia

    def properties() -> Any:
        found = ProximityProperties()
        AddContactMaterial(dissipation=1.0, friction=CoulombFriction(friction, friction), properties=found)
        return found

    rigid = properties()
    AddRigidHydroelasticProperties(resolution_hint=0.01, properties=rigid)
    box = plant.AddRigidBody("box", SpatialInertia(BOX_MASS, [0, 0, 0], UnitInertia.SolidBox(*BOX)))
    plant.RegisterCollisionGeometry(box, RigidTransform(), Box(*BOX), "box", rigid)
    deformables = plant.mutable_deformable_model()
    for side in (-1, 1):
        inertia = SpatialInertia(PADDLE_MASS, [0, 0, 0], UnitInertia.SolidBox(0.004, PAD[1], PAD[2]))
        paddle = plant.AddRigidBody(f"paddle{side}", inertia)
        joint = PrismaticJoint(f"joint{side}", plant.world_frame(), paddle.body_frame(), [-side, 0, 0], damping=5.0)
        plant.AddJointActuator(f"motor{side}", plant.AddJoint(joint))
        inner = 0.5 * BOX[0] + GAP
        path = folder / f"pad{side}.vtk"
        _write_pad(path, inner if side > 0 else -inner - PAD[0])
        pad = GeometryInstance(RigidTransform(), Mesh(str(path)), f"pad{side}")
        pad.set_proximity_properties(properties())
        config = DeformableBodyConfig()
        config.set_youngs_modulus(YOUNG)
        config.set_poissons_ratio(POISSON)
        config.set_mass_density(DENSITY)
        config.set_material_model(MaterialModel.kNeoHookean)
        config.set_stiffness_damping_coefficient(0.005)
        held = RigidTransform([side * (inner + PAD[0] + 0.0015), 0, 0])
        deformables.AddFixedConstraint(
            body_A_id=deformables.RegisterDeformableBody(pad, config, 1.0),
            body_B=paddle,
            X_BA=RigidTransform(),
            shape_G=Box(0.004, 0.2, 0.2),
            X_BG=held,
        )
    plant.Finalize()
    return box


def _write_pad(path: Path, start: float) -> None:
    """Write a pad that starts at x = ``start`` [m] as tetrahedra, in the legacy format of VTK."""
    points, tetrahedra = _tetrahedra()
    points = points + np.array([start, -0.5 * PAD[1], -0.5 * PAD[2]])
    lines = ["# vtk DataFile Version 3.0", "pad", "ASCII", "DATASET UNSTRUCTURED_GRID", f"POINTS {len(points)} double"]
    lines += [" ".join(f"{value:.12g}" for value in point) for point in points]
    lines += [f"CELLS {len(tetrahedra)} {5 * len(tetrahedra)}"]
    lines += ["4 " + " ".join(map(str, corners)) for corners in tetrahedra]
    lines += [f"CELL_TYPES {len(tetrahedra)}", *["10"] * len(tetrahedra)]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def _tetrahedra() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    counts = [cells + 1 for cells in CELLS]
    axes = [np.linspace(0.0, size, count) for size, count in zip(PAD, counts, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    numbers = np.arange(len(points)).reshape(counts)
    cells = [
        [numbers[i + a, j + b, k + c] for a in (0, 1) for b in (0, 1) for c in (0, 1)]
        for i in range(CELLS[0]) for j in range(CELLS[1]) for k in range(CELLS[2])
    ]  # fmt: skip
    found = np.array([[cell[place] for place in six] for cell in cells for six in _SIX])
    a, b, c, d = np.moveaxis(points[found], 1, 0)
    inverted = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) < 0.0
    found[inverted] = found[inverted][:, [0, 2, 1, 3]]
    return points, found

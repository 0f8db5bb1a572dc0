# SPDX-License-Identifier: Apache-2.0
"""A validated scene: all data of a simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators import Actuator, AttachedMass, Embedding, Load
from gdfe_ros.arms.arm import Arm
from gdfe_ros.constraints import Handle
from gdfe_ros.constraints.obstacle import SelfContact
from gdfe_ros.constraints.rigid_body import RigidBody, rigid_among
from gdfe_ros.materials import Material
from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.cells.face_fibres import FibreLayer
from gdfe_ros.results.contacts import ContactSensor
from gdfe_ros.scene.program import Program
from gdfe_ros.solver.settings import Dynamics, SolverSettings


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """A body, its materials, handles, actuators and loads, and the solver settings. SI units.

    Attributes:
        name: short name.
        description: a sentence that describes the scene.
        mesh: the body.
        materials: dict from name to material, in the order of the file.
        cell_material: index into `materials` of each cell, shape (m,), int32.
        handles: handles, obstacles, rigid bodies and links of arms.
        program: program that `gdfe solve` plays; None if the scene has no program.
        solver: settings of the solver.
        source: YAML text that rebuilds this scene without any other file, with the overrides applied; empty for a scene
            that was made in Python.
        path: path of the scene's file; None for a scene from text.
        actuators: actuators, in the order of the file.
        loads: dead loads, in the order of the file.
        probes: dict from name to material point, in the order of the file.
        sensors: dict from name to contact sensor, in the order of the file.
        masses: attached masses in the order of the file, then the masses of the rigid bodies.
        self_contact: faces of the mesh that may touch each other; None if they pass through each other.
        dynamics: inertia, damping and time steps; None if every step ends in a static equilibrium.
        fibres: layers of fibres, in the order of the file.
        arms: arms that carry handles, in the order of the file; their links are among the handles.
        soft_bodies: names of the soft bodies beside the body; they are parts of the mesh.
    """

    name: str
    description: str = ""
    mesh: HexMesh
    materials: Mapping[str, Material]
    cell_material: NDArray[np.int32]
    handles: tuple[Handle, ...]
    program: Program | None = None
    solver: SolverSettings = field(default_factory=SolverSettings)
    source: str = ""
    path: Path | None = None
    actuators: tuple[Actuator, ...] = ()
    loads: tuple[Load, ...] = ()
    probes: Mapping[str, Embedding] = field(default_factory=dict)
    sensors: Mapping[str, ContactSensor] = field(default_factory=dict)
    masses: tuple[AttachedMass, ...] = ()
    self_contact: SelfContact | None = None
    dynamics: Dynamics | None = None
    fibres: tuple[FibreLayer, ...] = ()
    arms: tuple[Arm, ...] = ()
    soft_bodies: tuple[str, ...] = ()

    @property
    def rigid_bodies(self) -> tuple[RigidBody, ...]:
        """The rigid bodies among the handles, in their order."""
        return rigid_among(self.handles)

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
from gdfe_ros.constraints.self_contact import SelfContact
from gdfe_ros.contacts import ContactSensor
from gdfe_ros.materials import Material
from gdfe_ros.mesh import HexMesh
from gdfe_ros.scene.program import Program
from gdfe_ros.solver.motion.dynamics import Dynamics
from gdfe_ros.solver.settings import SolverSettings


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """A body, its materials, handles, actuators and loads, and solver settings. SI units.

    Attributes:
        name: short name.
        description: one sentence for people.
        mesh: the body.
        materials: by name, in the order of the file.
        cell_material: index into `materials` of each cell, shape (m,), int32.
        handles: in the order of the file.
        program: played by `gdfe solve`; None if the scene has none.
        solver: settings.
        source: YAML text that rebuilds this scene without any other file, overrides included; empty for a scene
            that was made in Python.
        path: its file; None for text.
        actuators: cables, chambers and growths, in the order of the file.
        loads: dead loads, in the order of the file.
        probes: material points by name, in the order of the file.
        sensors: contact sensors by name, in the order of the file.
        masses: attached masses, in the order of the file.
        self_contact: faces of the mesh that may touch each other; None if they pass through each other.
        dynamics: inertia, damping and time steps; None if every step is an equilibrium.
        arms: arms that carry handles, in the order of the file; their links are among the handles.
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
    arms: tuple[Arm, ...] = ()

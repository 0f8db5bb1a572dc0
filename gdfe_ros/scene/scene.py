# SPDX-License-Identifier: Apache-2.0
"""A validated scene: everything that a simulation needs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators import Actuator, AttachedMass, Embedding, Load
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
    """A body, its materials, what holds and moves it, and how to solve it. SI units.

    Attributes:
        name: short name.
        description: one sentence for people.
        mesh: the body.
        materials: by name, in the order of the file.
        cell_material: index into `materials` of each cell, shape (m,), int32.
        handles: in the order of the file.
        program: what `gdfe solve` plays; None if the scene has none.
        solver: settings.
        source: YAML text that rebuilds this very scene without any other file, overrides included; empty for a scene
            that was made in Python.
        path: file that it came from; None for text.
        actuators: cables, chambers and growths, in the order of the file.
        loads: dead loads, in the order of the file.
        probes: material points by name, in the order of the file.
        sensors: contact sensors by name, in the order of the file.
        masses: attached masses, in the order of the file.
        self_contact: which faces of the mesh may touch each other; None where they pass through each other.
        dynamics: inertia, damping and steps in time; None for a scene whose every step is an equilibrium.
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

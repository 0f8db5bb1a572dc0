# SPDX-License-Identifier: Apache-2.0
"""From a scene file's sound parts to attached masses and dynamics."""

from __future__ import annotations

from collections.abc import Mapping

from gdfe_ros.actuators import AttachedMass
from gdfe_ros.materials import Material, lacks_density
from gdfe_ros.mesh import HexMesh, select_vertices
from gdfe_ros.scene.builder import select
from gdfe_ros.scene.report import NO_VALUE, Report
from gdfe_ros.scene.schema import Draft
from gdfe_ros.solver.motion.dynamics import Dynamics
from gdfe_ros.solver.settings import Policy


def build_masses(draft: Draft, mesh: HexMesh | None, report: Report) -> tuple[AttachedMass, ...]:
    """Return the attached masses whose vertices can be found."""
    found = []
    for name, model in draft.masses.items() if mesh is not None else ():
        vertices = select(select_vertices, mesh, model.where, ("masses", name, "where"), "vertex", report)
        if vertices is not None:
            found.append(AttachedMass(name=name, vertices=vertices, mass=model.mass))
    return tuple(found)


def build_dynamics(draft: Draft, materials: Mapping[str, Material], policy: Policy, report: Report) -> Dynamics | None:
    """Return the dynamics; they need forces and the density of every material."""
    if draft.dynamics is None:
        return None
    if text := lacks_inertia(materials, policy):
        report.add(("dynamics",), text, value=NO_VALUE)
    return draft.dynamics.build()


def lacks_inertia(materials: Mapping[str, Material], policy: Policy) -> str:
    """Say why a body cannot move in time; empty where it can."""
    if policy is not Policy.ENERGY:
        return "the policy 'relative' has no forces and finds equilibria only; remedy: policy: energy"
    return lacks_density(materials, "dynamics need")

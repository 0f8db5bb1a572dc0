# SPDX-License-Identifier: Apache-2.0
"""From a scene file's sound parts to attached masses and dynamics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gdfe_ros.actuators import AttachedMass, Embedding
from gdfe_ros.materials import Material
from gdfe_ros.mesh import HexMesh, select_vertices
from gdfe_ros.scene.builder import select
from gdfe_ros.scene.report import NO_VALUE, Report, suggest
from gdfe_ros.scene.schema import Draft
from gdfe_ros.solver.motion.dynamics import Dynamics
from gdfe_ros.solver.settings import Policy


def build_masses(
    draft: Draft, mesh: HexMesh | None, probes: Mapping[str, Embedding], names: Sequence[str], report: Report
) -> tuple[AttachedMass, ...]:
    """Return the attached masses whose place in the body can be found.

    Args:
        draft: the file's sound parts.
        mesh: the body.
        probes: those that lie in it.
        names: of all probes of the file.
        report: takes the defects.
    """
    found = []
    for name, model in draft.masses.items() if mesh is not None else ():
        points = probes.get(model.probe)
        if model.where is not None:
            vertices = select(select_vertices, mesh, model.where, ("masses", name, "where"), "vertex", report)
            points = None if vertices is None else Embedding.of_vertices(vertices)
        elif model.probe not in names:
            report.add(("masses", name, "probe"), f"there is no such probe{suggest(model.probe, names)}")
        if points is not None:
            found.append(AttachedMass(name=name, points=points, mass=model.mass))
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
    light = [key for key, material in materials.items() if material.density is None]
    if light:
        return f"dynamics need a density: give `density` [kg/m^3] to {', '.join(light)}"
    return ""

# SPDX-License-Identifier: Apache-2.0
"""A cylinder cut from voxels bends as a cylinder, along the grid and across it."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from gdfe_ros.command import Command
from gdfe_ros.constraints import Pose
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.mesh.files.stored_mesh import pack_mesh
from gdfe_ros.mesh.meshing.voxels import CutCubes, fill_surface
from test.written import simulate

RADIUS, LENGTH, YOUNG, POISSON = 0.01, 0.06, 1e5, 0.3
SECTIONS = 360
"""Number of sides of the prism that replaces the cylinder; its second moment is 2e-4 below that of the circle."""
ANGLE = 1e-3
"""Rotation of each end [rad]; it is small, so that linear theory is valid."""
MIDDLE = 0.25
"""Middle fraction of the length over which the curvature is measured, away from the clamped ends."""
HELD = 0.95
"""Fraction of half the length beyond which vertices belong to the rotated ends."""


def cylinder(direction: float) -> trimesh.Trimesh:
    """Return the surface of the cylinder with its centre at the origin and its axis in the x-y plane."""
    body = trimesh.creation.cylinder(RADIUS, LENGTH, sections=SECTIONS)
    body.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    return body.apply_transform(trimesh.transformations.rotation_matrix(np.radians(direction), [0, 0, 1]))


def bending_stiffness(fineness: int, cells: str, direction: float) -> float:
    """Rotate both ends of the cylinder so that it bends without shear, and return its stiffness over E I of the circle.

    Args:
        fineness: number of cells over the diameter.
        cells: treatment of the cubes that the surface cuts, ``whole`` or ``cut``.
        direction: angle of the axis in the grid [degrees].
    """
    cell, angle = 2.0 * RADIUS / fineness, np.radians(direction)
    axis, across = np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([-np.sin(angle), np.cos(angle), 0.0])
    body = cylinder(direction)
    mesh = fill_surface(body.vertices, body.faces, cell=cell, cells=CutCubes(cells))
    along = mesh.vertices @ axis
    ends = [np.flatnonzero(sign * along > HELD * LENGTH / 2.0).tolist() for sign in (-1.0, 1.0)]
    soft = f"materials: {{soft: {{law: linear, young: {YOUNG}, poisson: {POISSON}}}}}"
    handles = {name: {"where": {"vertices": end}} for name, end in zip(("left", "right"), ends, strict=True)}
    solver = {"tolerance": 1e-8, "max_iterations": 20000}
    simulation = simulate(soft, mesh={"embedded": pack_mesh(mesh)}, handles=handles, solver=solver)
    turned = {"left": Pose(rotation=tuple(ANGLE * across)), "right": Pose(rotation=tuple(-ANGLE * across))}
    result = simulation.step(Command(handles=turned))
    rest = mesh.vertices
    side, height = rest @ across, rest[:, 2]
    chosen = (np.abs(along) < MIDDLE * LENGTH / 2.0 + 0.5 * cell) & (np.hypot(side, height) < RADIUS)
    moved = ((result.positions - rest) @ axis)[chosen]
    terms = np.stack([np.ones_like(along), along, height, along * height], axis=1)[chosen]
    curvature = np.linalg.lstsq(terms / terms.max(axis=0), moved, rcond=None)[0][3] / terms[:, 3].max()
    moment = 0.5 * float((result.reactions["right"][3:] - result.reactions["left"][3:]) @ across)
    assert result.converged, result.message
    return float(moment / curvature / (YOUNG * np.pi / 4.0 * RADIUS**4))


@pytest.mark.parametrize("direction", [0.0, 30.0])
def test_cut_cells_bend_as_the_cylinder_that_they_are_cut_from(direction: float) -> None:
    """A cylinder of 6 cut cells per diameter bends with E I within 3 %; whole cubes have more than twice its error."""
    cut, whole = (bending_stiffness(6, kind, direction) for kind in ("cut", "whole"))
    assert cut == pytest.approx(1.0, abs=0.03)
    assert abs(whole - 1.0) > 2.0 * abs(cut - 1.0)


def sag(mesh: HexMesh) -> float:
    """Return the sag [m] of the free end of a clamped bar under its weight, read at a point near its end."""
    soft = "materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1000}}"
    simulation = simulate(
        soft,
        mesh={"embedded": pack_mesh(mesh)},
        handles={"base": {"where": {"face": "x-"}, "fixed": True}},
        loads={"weight": {"gravity": [0.0, 0.0, -9.81]}},
        probes={"end": [0.059, 0.0, 0.0]},
    )
    assert simulation.step().converged
    return -float(simulation.probe_positions()["end"][2])


@pytest.mark.parametrize("cell", [0.0037, 0.0026])
def test_a_handle_outside_of_a_cut_body_holds_it_less_stiffly(cell: float) -> None:
    """A clamped bar whose length is no multiple of the cell sags by a fifth to a quarter too far."""
    body = trimesh.creation.box((0.06, 0.02, 0.02)).apply_translation((0.03, 0.0, 0.0))
    cut = fill_surface(body.vertices, body.faces, cell=cell, cells=CutCubes.CUT)
    assert 1.2 < sag(cut) / sag(bar([0.06, 0.02, 0.02], [24, 8, 8])) < 1.25

# SPDX-License-Identifier: Apache-2.0
"""Triangles between the contact points of a skin: closed, of the skin's volume, with its edges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.assembly import mirror
from gdfe_ros.mesh.contact_skin import touch_by_skin
from gdfe_ros.mesh.meshing.voxels import CutCubes, fill_surface
from gdfe_ros.mesh.outside import carry_skin
from gdfe_ros.mesh.surfaces.surface_edges import edge_counts

BALL = trimesh.creation.icosphere(4, 0.05)
BOX = trimesh.creation.box((0.06, 0.04, 0.03))
TURNED = BOX.copy().apply_transform(trimesh.transformations.rotation_matrix(0.4, [1, 2, 3]))
HOLLOW = trimesh.util.concatenate(BALL, trimesh.creation.icosphere(4, 0.03))
ROD = trimesh.creation.cylinder(0.01, 0.06, sections=48)


def touching(surface: trimesh.Trimesh, cell: float) -> HexMesh:
    """Return a body of cut cells that touches by its surface."""
    points, triangles = np.array(surface.vertices), np.array(surface.faces)
    mesh = fill_surface(points, triangles, cell=cell, cells=CutCubes.CUT)
    mesh = replace(mesh, skin=carry_skin(mesh.vertices, mesh.cells, points, triangles))
    return touch_by_skin(mesh, points, triangles)


def volume_of(mesh: HexMesh) -> float:
    """Return the signed volume [m^3] inside the triangles of contact points."""
    a, b, c = np.moveaxis(mesh.touching.at(mesh.vertices)[mesh.touching.faces], 1, 0)
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6.0)


@pytest.mark.parametrize(
    ("surface", "cell", "within"),
    [
        (BALL, 0.01, 0.03),
        (BALL, 0.005, 0.008),
        (BOX, 0.01, 1e-6),
        (TURNED, 0.01, 5e-3),
        (HOLLOW, 0.01, 0.04),
        (ROD, 0.004, 0.1),
    ],
    ids=["ball", "fine ball", "box", "turned box", "hollow ball", "rod"],
)
def test_they_are_closed_and_fill_the_skin(surface: trimesh.Trimesh, cell: float, within: float) -> None:
    """Each edge has as many triangles in one direction as in the other; the volume is the skin's."""
    mesh = touching(surface, cell)
    _, count, balance = edge_counts(mesh.touching.faces)
    assert (count % 2 == 0).all()
    assert not balance.any()
    assert np.unique(mesh.touching.faces).tolist() == list(range(len(mesh.touching.corners)))
    wanted = BALL.volume - BALL.volume * 0.6**3 if surface is HOLLOW else surface.volume
    assert volume_of(mesh) == pytest.approx(wanted, rel=within)
    assert volume_of(mirror(mesh, 0)) == pytest.approx(wanted, rel=within)
    edges = mesh.touching.at(mesh.vertices)[mesh.touching.faces]
    assert np.linalg.norm(edges - np.roll(edges, 1, axis=1), axis=2).max() < 2.5 * cell


def test_the_wall_of_a_cup_has_two_sides() -> None:
    """Triangles of a wall thinner than a cell join points of one side only."""
    mesh = touching(trimesh.creation.annulus(0.020, 0.022, 0.03, sections=64), 0.004)
    points = mesh.touching.at(mesh.vertices)
    outer = np.linalg.norm(points[:, :2], axis=1) > 0.021
    inner_rims = np.abs(points[:, 2]) > 0.0149
    for face in mesh.touching.faces:
        if not inner_rims[face].any():
            assert len(set(outer[face])) == 1


def test_no_triangles_have_no_edges() -> None:
    """Of no triangles, edges, counts and directions are empty arrays of the usual shapes."""
    edges, count, balance = edge_counts(np.zeros((0, 3), dtype=np.int64))
    assert (edges.shape, count.shape, balance.shape) == ((0, 2), (0,), (0,))

# SPDX-License-Identifier: Apache-2.0
"""Meshes of tetrahedra: faces, shape functions, import, and packing in a scene's text."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest
from scipy.special import factorial

from gdfe_ros.actuators.embedding import embed
from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import TetMesh, bar, check_mesh
from gdfe_ros.mesh.assembly import keep_cells
from gdfe_ros.mesh.cavities import find_cavities, inside_volume
from gdfe_ros.mesh.cells.tetrahedra import (
    EDGES,
    barycentric,
    node_areas,
    quadratic_slopes,
    quadratic_weights,
    simplex_rule,
)
from gdfe_ros.mesh.files.importer import read_mesh
from gdfe_ros.mesh.generators import sphere
from gdfe_ros.mesh.tetmesh import divide

BAR = divide(bar([0.2, 0.05, 0.05], [4, 1, 1]))
CORNERS = np.unique(BAR.cells[:, :4])
GMSH = {"msh": {"file_format": "gmsh"}}
LINEAR = np.searchsorted(CORNERS, BAR.cells[:, :4])


def test_shape_functions_are_one_at_their_own_node() -> None:
    """Each shape function is 1 at its own node and 0 at the nine others, and the slopes sum to zero."""
    places = np.concatenate([np.eye(4), 0.5 * (np.eye(4)[EDGES[:, 0]] + np.eye(4)[EDGES[:, 1]])])
    np.testing.assert_allclose(quadratic_weights(places), np.eye(10), atol=1e-15)
    np.testing.assert_allclose(quadratic_slopes(places).sum(axis=1), 0.0, atol=1e-14)


@pytest.mark.parametrize("powers", [(0, 0, 0, 0), (2, 1, 0, 1), (3, 2, 0, 0), (1, 1, 1, 2)])
def test_the_rule_integrates_polynomials_exactly(powers: tuple[int, ...]) -> None:
    """The rule integrates monomials of degree 5 over a tetrahedron exactly: 3! prod p_i! / (3 + sum p_i)!."""
    places, weights = simplex_rule(3)
    exact = 6.0 * factorial(powers).prod() / factorial(3 + sum(powers))
    assert weights @ np.prod(places**powers, axis=1) == pytest.approx(exact, rel=1e-13)


def test_a_point_is_found_in_a_curved_cell() -> None:
    """For a point made in a curved cell, its reference coordinates are found."""
    nodes = BAR.vertices[BAR.cells[0]] + np.random.default_rng(0).uniform(-0.002, 0.002, (10, 3))
    place = np.array([[0.1, 0.2, 0.3, 0.4]])
    np.testing.assert_allclose(barycentric(quadratic_weights(place) @ nodes, nodes[None]), place, atol=1e-12)


def test_faces_enclose_the_body() -> None:
    """The faces have the body's area and volume, with normals out of the material."""
    faces = BAR.surface()
    assert faces.shape == (2 * 18, 6)
    assert node_areas(BAR.vertices, faces).sum() == pytest.approx(4 * 0.2 * 0.05 + 2 * 0.05**2)
    np.testing.assert_allclose(node_areas(BAR.vertices, faces)[:, :3], 0.0, atol=1e-16)
    assert inside_volume(BAR.vertices, faces) == pytest.approx(0.2 * 0.05**2)
    assert check_mesh(BAR).volume == pytest.approx(0.2 * 0.05**2)
    assert check_mesh(BAR).defects == []


def test_a_cavity_is_found() -> None:
    """The cavity of a block with a hole is found, with faces directed into the material."""
    block = bar([0.3, 0.3, 0.3], [3, 3, 3])
    hollow = divide(keep_cells(block, np.arange(27) != 13))
    (cavity,) = find_cavities(hollow)
    assert cavity.volume == pytest.approx(1e-3)
    assert cavity.quads.shape == (12, 6)


def test_points_are_embedded_with_quadratic_weights() -> None:
    """An embedded point follows a quadratic motion exactly, and a point outside is refused by name."""
    points = np.random.default_rng(2).uniform([0.0, -0.025, -0.025], [0.2, 0.025, 0.025], (20, 3))
    found = embed(BAR, points, what="points")

    def bent(x: np.ndarray) -> np.ndarray:
        return x + np.stack([x[:, 1] * x[:, 2], x[:, 0] ** 2, x[:, 0] * x[:, 1]], axis=1)

    np.testing.assert_allclose(found.at(bent(BAR.vertices)), bent(points), atol=1e-9)
    with pytest.raises(MeshError, match="outside of the body"):
        embed(BAR, [0.3, 0.0, 0.0], what="points")


@pytest.mark.parametrize("suffix", ["vtu", "msh", "inp"])
def test_linear_tetrahedra_are_raised(tmp_path: Path, suffix: str) -> None:
    """Linear tetrahedra get a node on each edge, keep their corners, and their sets are adapted."""
    low = np.flatnonzero(BAR.vertices[CORNERS, 0] == 0.0)
    raw = meshio.Mesh(BAR.vertices[CORNERS], [("tetra", LINEAR)], point_sets={"grip": low} if suffix == "inp" else {})
    raw.write(tmp_path / f"bar.{suffix}", **GMSH.get(suffix, {}))
    mesh = read_mesh(tmp_path / f"bar.{suffix}")
    assert isinstance(mesh, TetMesh)
    assert mesh.linear
    assert (mesh.n_cells, mesh.n_vertices) == (BAR.n_cells, BAR.n_vertices)
    assert check_mesh(mesh).volume == pytest.approx(0.2 * 0.05**2)
    if suffix == "inp":
        np.testing.assert_allclose(mesh.vertices[mesh.vertex_sets["grip"], 0], 0.0, atol=1e-12)
        assert len(mesh.vertex_sets["grip"]) == 9


@pytest.mark.parametrize("suffix", ["vtu", "msh"])
def test_quadratic_tetrahedra_keep_their_nodes(tmp_path: Path, suffix: str) -> None:
    """Ten-node cells are read unchanged, whatever the order of nodes in the format."""
    raw = meshio.Mesh(BAR.vertices, [("tetra10", BAR.cells)])
    raw.write(tmp_path / f"bar.{suffix}", **GMSH.get(suffix, {}))
    mesh = read_mesh(tmp_path / f"bar.{suffix}")
    assert not mesh.linear
    middles = mesh.vertices[mesh.cells[:, EDGES]].mean(axis=2)
    np.testing.assert_allclose(mesh.vertices[mesh.cells[:, 4:]], middles, atol=1e-12)


def test_inverted_cells_are_named_with_their_place(tmp_path: Path) -> None:
    """Cells with corners in the wrong order are reported by their number and the first one's place."""
    cells = LINEAR.copy()
    cells[[3, 7]] = cells[[3, 7]][:, [0, 2, 1, 3]]
    meshio.Mesh(BAR.vertices[CORNERS], [("tetra", cells)]).write(tmp_path / "bad.vtu")
    with pytest.raises(MeshError, match=r"2 cells that are inside out: 3, 7, the first near \("):
        read_mesh(tmp_path / "bad.vtu")


def test_two_kinds_of_cells_in_a_file_are_refused(tmp_path: Path) -> None:
    """A file with two kinds of cells is refused with both kinds and their counts."""
    block = bar([0.1, 0.1, 0.1], [1, 1, 1])
    cells = [("hexahedron", block.cells), ("tetra", block.cells[:, [0, 1, 2, 6]])]
    meshio.Mesh(block.vertices, cells).write(tmp_path / "mixed.vtu")
    with pytest.raises(MeshError, match="several kinds: 1 hexahedron, 1 tetra"):
        read_mesh(tmp_path / "mixed.vtu")


def test_the_volume_of_a_ball_has_an_error_of_straight_edges() -> None:
    """Tetrahedra of a hollow ball match at all inner faces; with straight edges its volume is up to 10 % too small."""
    ball = sphere(0.05, 0.1, [4, 1])
    mesh = divide(ball)
    assert len(mesh.surface()) == 2 * len(ball.surface())
    exact = 4.0 / 3.0 * np.pi * (0.1**3 - 0.05**3)
    assert 0.9 * exact < check_mesh(mesh).volume < exact

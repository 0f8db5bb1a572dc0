# SPDX-License-Identifier: Apache-2.0
"""Generated meshes: bars, grids, tubes, rings and hollow spheres."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import HexMesh, bar, check_mesh
from gdfe_ros.mesh.cavities import find_cavities
from gdfe_ros.mesh.generators import grid, ring, sphere, tube


def test_bar_numbers_vertices_and_cells_as_documented() -> None:
    """Vertex i+(nx+1)(j+(ny+1)k) and cell i+nx(j+ny k) are at their places on the grid."""
    nx, ny, nz = 3, 2, 4
    mesh = bar([0.3, 0.2, 0.8], [nx, ny, nz])
    for i, j, k in np.ndindex(nx + 1, ny + 1, nz + 1):
        index = i + (nx + 1) * (j + (ny + 1) * k)
        np.testing.assert_allclose(mesh.vertices[index], [0.1 * i, 0.1 * j - 0.1, 0.2 * k - 0.4], atol=1e-15)
    for i, j, k in np.ndindex(nx, ny, nz):
        expected = [0.1 * (i + 0.5), 0.1 * (j + 0.5) - 0.1, 0.2 * (k + 0.5) - 0.4]
        np.testing.assert_allclose(mesh.centroids[i + nx * (j + ny * k)], expected, atol=1e-15)


def test_grid_has_the_planes_asked_for() -> None:
    """A block with uneven planes has all planes, and every cell its volume."""
    x, y, z = [0.0, 0.1, 0.4], [-0.2, 0.3], [0.0, 0.01, 0.02, 0.1]
    mesh = grid(x, y, z)
    for axis, planes in enumerate((x, y, z)):
        np.testing.assert_array_equal(np.unique(mesh.vertices[:, axis]), planes)
    assert mesh.n_cells == 2 * 1 * 3
    assert check_mesh(mesh).volume == pytest.approx(0.4 * 0.5 * 0.1, rel=1e-14)


def test_grid_names_every_bad_argument() -> None:
    """A single plane, two equal ones, and one that is no number are refused, each by name."""
    with pytest.raises(MeshError) as caught:
        grid([0.0], [0.0, 0.0, 0.1], [0.0, np.nan])
    assert [defect.split(" ")[0] for defect in caught.value.defects] == ["grid.x", "grid.y", "grid.z"]


def sound_volume(mesh: HexMesh) -> float:
    """Return the volume of a mesh that must be one sound piece."""
    report = check_mesh(mesh)
    assert report.defects == []
    assert report.parts == 1
    assert report.min_scaled_jacobian > 0.4
    return report.volume


@pytest.mark.parametrize(
    ("make", "exact"),
    [
        (lambda n: tube(1.0, 2.0, 3.0, [2, 2 * n, 2]), np.pi * 3 * 3),
        (lambda n: ring(2.0, [1.0, 0.5], [2, 2 * n, 1]), 2 * np.pi * 2 * 0.5),
        (lambda n: ring(2.0, [1.0, 0.5], [2, n, 1], angle=90), 0.5 * np.pi * 2 * 0.5),
        (lambda n: sphere(1.0, 2.0, [n, 4]), 4 / 3 * np.pi * 7),
    ],
)
def test_volumes_converge_with_order_two(make: object, exact: float) -> None:
    """Halving the cells around, twice, reduces the volume error to a quarter each time."""
    errors = np.array([exact - sound_volume(make(n)) for n in (8, 16, 32)])
    assert (abs(np.log2(errors[:-1] / errors[1:]) - 2) < 0.1).all()


@pytest.mark.parametrize("around", [4, 8, 24])
def test_a_capped_tube_encloses_one_chamber(around: int) -> None:
    """A capped tube has one cavity, between the caps."""
    mesh = tube(0.01, 0.02, 0.1, [2, around, 6], cap=0.01, cap_cells=2)
    (cavity,) = find_cavities(mesh)
    polygon = around / 2 * np.sin(2 * np.pi / around)
    assert cavity.volume == pytest.approx(polygon * 0.01**2 * 0.08)
    assert sound_volume(mesh) == pytest.approx(polygon * (0.02**2 * 0.1 - 0.01**2 * 0.08))
    assert set(np.unique(cavity.quads)) >= set(mesh.vertex_sets["inner"])


def test_sets_of_a_tube_lie_where_they_should() -> None:
    """A tube's inner and outer sets are on their radii, start and end on their planes."""
    mesh = tube(0.01, 0.02, 0.1, [2, 12, 5])
    radius = np.hypot(*mesh.vertices[:, 1:].T)
    np.testing.assert_allclose(radius[mesh.vertex_sets["inner"]], 0.01)
    np.testing.assert_allclose(radius[mesh.vertex_sets["outer"]], 0.02)
    assert (mesh.vertices[mesh.vertex_sets["start"], 0] == 0).all()
    assert [len(mesh.vertex_sets[name]) for name in ("inner", "outer", "start", "end")] == [72, 72, 36, 36]


def test_sets_of_an_arc_are_its_ends() -> None:
    """An arc of 90 degrees starts on the x axis and ends on the y axis."""
    mesh = ring(0.05, [0.01, 0.02], [2, 9, 3], angle=90)
    np.testing.assert_allclose(mesh.vertices[mesh.vertex_sets["start"], 1], 0, atol=1e-17)
    np.testing.assert_allclose(mesh.vertices[mesh.vertex_sets["end"], 0], 0, atol=1e-17)
    assert len(mesh.vertex_sets["start"]) == len(mesh.vertex_sets["end"]) == 12


def test_round_bodies_do_not_depend_on_scale() -> None:
    """The seam of a tube of micrometres is merged."""
    small, large = tube(1e-6, 2e-6, 5e-6, [2, 8, 3], cap=1e-6), tube(1.0, 2.0, 5.0, [2, 8, 3], cap=1.0)
    np.testing.assert_array_equal(small.cells, large.cells)
    assert {k: len(v) for k, v in small.vertex_sets.items()} == {k: len(v) for k, v in large.vertex_sets.items()}


@pytest.mark.parametrize(
    ("make", "defects"),
    [
        (lambda: tube(0.02, 0.01, 0.1, [1, 2, 1], cap=0.06), 3),
        (lambda: tube(0.01, 0.02, 0.1, [1, 6, 1], cap=0.01), 1),
        (lambda: ring(0.1, [0.2, 0.1], [1, 2, 1]), 2),
        (lambda: sphere(0.2, 0.1, [2, 2]), 1),
    ],
)
def test_arguments_that_do_not_fit_are_all_named(make: object, defects: int) -> None:
    """All bad arguments are reported together with what is allowed."""
    with pytest.raises(MeshError) as caught:
        make()
    assert len(caught.value.defects) == defects
    assert all("allowed" in text for text in caught.value.defects)

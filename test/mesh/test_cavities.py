# SPDX-License-Identifier: Apache-2.0
"""Cavities are found, separated and oriented."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.mesh import bar, select_faces
from gdfe_ros.mesh.cavities import find_cavities
from gdfe_ros.mesh.cells.faces import enclosed_volume
from gdfe_ros.mesh.generators import cut, sphere
from gdfe_ros.mesh.selection import BoxSelection, Side, Where
from gdfe_ros.mesh.surfaces.surface_edges import open_edges

CUBE = bar([1, 1, 1], [5, 5, 5])
MIDDLE = Where(box=BoxSelection((0.2, 0.8), (-0.3, 0.3), (-0.3, 0.3)))


def test_a_solid_body_has_no_cavity() -> None:
    """A bar, and a bar with a channel through it, have no cavity."""
    assert find_cavities(CUBE) == []
    assert find_cavities(cut(CUBE, [Where(box=BoxSelection(y=(-0.1, 0.1), z=(-0.1, 0.1)))])) == []


def test_a_cavity_has_its_volume_center_and_outward_quads() -> None:
    """A cavity of 3 x 3 x 3 cells has its volume and centre; its quads face outward to the cells behind them."""
    body = cut(CUBE, [MIDDLE])
    (cavity,) = find_cavities(body)
    assert cavity.quads.shape == (54, 4)
    assert cavity.quads.dtype == np.int32
    assert cavity.volume == pytest.approx(0.6**3)
    np.testing.assert_allclose(cavity.center, [0.5, 0, 0], atol=1e-14)
    corners = body.vertices[cavity.quads]
    normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    assert (np.einsum("ij,ij->i", normals, corners.mean(axis=1) - cavity.center) > 0).all()


def test_several_cavities_come_largest_first() -> None:
    """Cavities are sorted by decreasing volume."""
    body = cut(
        CUBE,
        [
            Where(box=BoxSelection((0.2, 0.4), (-0.1, 0.1), (-0.1, 0.1))),
            Where(box=BoxSelection((0.6, 0.8), (-0.3, 0.3), (-0.1, 0.1))),
        ],
    )
    assert [cavity.volume for cavity in find_cavities(body)] == pytest.approx([0.024, 0.008])


@pytest.mark.parametrize(
    "second",
    [
        Where(box=BoxSelection((0.4, 0.6), (-0.1, 0.1), (-0.3, 0.3))),
        Where(box=BoxSelection((0.4, 0.6), (-0.1, 0.1), (-0.3, -0.1))),
    ],
)
def test_cavities_that_touch_at_an_edge_stay_apart(second: Where) -> None:
    """Two cavities whose walls share vertices along an edge are separate."""
    body = cut(CUBE, [Where(box=BoxSelection((0.2, 0.4), (-0.3, -0.1), (-0.3, 0.3))), second])
    cavities = find_cavities(body)
    assert len(cavities) == 2
    assert sum(cavity.volume for cavity in cavities) == pytest.approx((125 - body.n_cells) * 0.008)
    assert all(len(open_edges(cavity.quads)) == 0 for cavity in cavities)


def test_a_cavity_that_touches_the_outside_at_an_edge_is_closed() -> None:
    """A cavity that meets a notch only along an edge is closed."""
    body = cut(CUBE, [MIDDLE, Where(box=BoxSelection((0.8, 1.0), (0.3, 0.5), (-0.3, 0.3)))])
    (cavity,) = find_cavities(body)
    assert cavity.volume == pytest.approx(0.6**3)


def test_material_inside_a_cavity_is_not_a_cavity() -> None:
    """A layer of cells between two cavities belongs to the body, whose surface encloses the cells' volume."""
    body = cut(
        CUBE,
        [
            Where(box=BoxSelection((0.2, 0.8), (-0.3, 0.3), (-0.3, -0.1))),
            Where(box=BoxSelection((0.2, 0.8), (-0.3, 0.3), (0.1, 0.3))),
        ],
    )
    assert len(find_cavities(body)) == 2
    volume = enclosed_volume(body.vertices, body.surface())
    assert volume == pytest.approx(body.n_cells * 0.008)


def test_enclosed_volume_of_a_curved_cavity_converges() -> None:
    """The enclosed volume of a curved cavity converges to 4/3 pi r^3 at second order."""
    exact = 4 / 3 * np.pi
    errors = [exact - find_cavities(sphere(1.0, 2.0, [n, 1]))[0].volume for n in (6, 12, 24)]
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (abs(rates - 2) < 0.1).all()


def test_open_edges_name_the_leak() -> None:
    """Without one quad, a closed surface has four open edges, which are returned."""
    (cavity,) = find_cavities(cut(CUBE, [MIDDLE]))
    assert open_edges(cavity.quads).shape == (0, 2)
    leak = open_edges(cavity.quads[1:])
    assert sorted(set(leak.ravel().tolist())) == sorted(cavity.quads[0].tolist())
    assert len(leak) == 4


def test_faces_are_selected_by_their_vertices() -> None:
    """The 25 quads of one side are selected by their vertices and face outward."""
    quads = select_faces(CUBE, Where(face=Side.X_LOW))
    assert quads.shape == (25, 4)
    corners = CUBE.vertices[quads]
    assert (np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])[:, 0] < 0).all()

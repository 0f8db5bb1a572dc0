# SPDX-License-Identifier: Apache-2.0
"""Solids with signed distances, from closed surfaces."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.meshing.voxels import read_surface
from gdfe_ros.mesh.surfaces.solid import Solid, make_solid

BOX = trimesh.creation.box((0.1, 0.06, 0.04))


def read_solid(path: Path, *, scale: float | None = None, cell: float | None = None) -> Solid:
    """Return the solid of a file, as an obstacle reads it."""
    return make_solid(*read_surface(path, scale=scale), cell=cell)


def test_distances_are_those_of_the_nearest_triangle() -> None:
    """At each point of a grid around a torus, distance and sign are those of a search over all triangles."""
    torus = trimesh.creation.torus(0.05, 0.02)
    solid = make_solid(torus.vertices, torus.faces, cell=0.006)
    axes = [start + solid.cell * np.arange(n) for start, n in zip(solid.start, solid.distances.shape, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    some = np.random.default_rng(1).choice(len(points), 60, replace=False)
    for point, found in zip(points[some], solid.distances.ravel()[some], strict=True):
        spread = np.broadcast_to(point, (len(torus.faces), 3))
        nearest = trimesh.triangles.closest_point(torus.triangles, spread)
        assert abs(found) == pytest.approx(np.linalg.norm(nearest - point, axis=1).min(), abs=1e-15)
        assert (found < 0) == (np.hypot(np.hypot(point[0], point[1]) - 0.05, point[2]) < 0.02) or abs(found) < 1e-3


def test_a_cavity_is_outside() -> None:
    """Inside a cavity the distance is positive, in its wall negative."""
    hollow = trimesh.util.concatenate([BOX, BOX.copy().apply_scale(0.5)])
    solid = make_solid(hollow.vertices, hollow.faces)
    middle = tuple(n // 2 for n in solid.distances.shape)
    assert solid.distances[middle] == pytest.approx(0.01, abs=1e-3)
    assert solid.distances[middle[0], middle[1], middle[2] + 10] < -0.003


def test_a_surface_is_read_in_its_unit_and_measured_once(tmp_path: Path) -> None:
    """A surface in millimetres becomes a solid in metres, which is computed once."""
    BOX.copy().apply_scale(1000.0).export(tmp_path / "part.stl")
    solid = read_solid(tmp_path / "part.stl", scale=0.001)
    np.testing.assert_allclose(np.ptp(solid.vertices, axis=0), [0.1, 0.06, 0.04])
    assert read_solid(tmp_path / "part.stl", scale=0.001) is solid


def opened() -> trimesh.Trimesh:
    """Return a box that lacks one of its triangles."""
    return trimesh.Trimesh(BOX.vertices, BOX.faces[:-1], process=False)


def turned() -> trimesh.Trimesh:
    """Return a box whose triangles face inward."""
    return trimesh.Trimesh(BOX.vertices, BOX.faces[:, ::-1], process=False)


@pytest.mark.parametrize(
    ("surface", "options", "expected"),
    [
        (opened(), {}, r"the surface is open: 3 edges .* remedy: close the holes"),
        (turned(), {}, r"inside out: it bounds a volume of -0.00024 m\^3; remedy: turn its triangles around"),
        (BOX.copy().apply_scale(1000.0), {}, r"diagonal is 123.* not in metres .*`scale: 0.001`"),
        (BOX, {"cell": 1e-5}, r"a grid of .* points; allowed: up to .*; remedy: a cell of at least"),
        (BOX, {"cell": 0.09}, r"% of the surface's volume; remedy: a smaller cell"),
    ],
)
def test_bad_surfaces_are_refused(
    tmp_path: Path, surface: trimesh.Trimesh, options: dict[str, float], expected: str
) -> None:
    """A bad surface is refused with the reason and a remedy."""
    surface.export(tmp_path / "part.stl")
    with pytest.raises(MeshError) as caught:
        read_solid(tmp_path / "part.stl", **options)
    assert re.search(expected, str(caught.value)), caught.value

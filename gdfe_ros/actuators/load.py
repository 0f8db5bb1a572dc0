# SPDX-License-Identifier: Apache-2.0
"""Loads: forces whose size and direction stay constant while the body moves, and pressures that follow it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.embedding import Embedding
from gdfe_ros.mesh.cells.filling import CORNERS, Filling, trilinear_slopes, trilinear_weights
from gdfe_ros.mesh.cells.tetrahedra import node_areas, quadratic_slopes, quadratic_weights, simplex_rule

GAUSS = 3.0**-0.5
"""Absolute value of the reference coordinates of the two Gauss points in each direction."""
TET_ORDER = 3
"""Number of integration points of a tetrahedron along each direction; products of two shape functions have degree 4."""
LOAD_FACTOR = 1.0
"""Default command of a load."""


@dataclass(frozen=True, eq=False, kw_only=True)
class AttachedMass:
    """A mass that is attached in equal parts to several material points of the body.

    Attributes:
        name: name, unique among attached masses.
        points: material point of each part.
        mass: total mass [kg].
    """

    name: str
    points: Embedding
    mass: float

    @property
    def part(self) -> float:
        """Mass of each part [kg]."""
        return self.mass / len(self.points.corners)

    def forces(self, count: int, acceleration: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the weight (count, 3) [N] at each of ``count`` vertices, under an acceleration (3,) [m/s^2]."""
        return _collect(count, self.points.corners, (self.part * self.points.weights)[..., None] * acceleration)


@dataclass(frozen=True, eq=False, kw_only=True)
class Gravity:
    """The weight of the cells and of attached masses.

    Attributes:
        name: name, unique among the actuators and loads of the scene.
        acceleration: (3,) gravitational acceleration [m/s^2], finite.
        density: (m,) density of each cell [kg/m^3].
        attached: attached masses.
        filling: filled fraction of the cells; None if every cell is entirely filled.
    """

    name: str
    acceleration: NDArray[np.float64]
    density: NDArray[np.float64]
    attached: tuple[AttachedMass, ...] = ()
    filling: Filling | None = None

    def __post_init__(self) -> None:
        _require_finite(self.name, "acceleration", self.acceleration)

    def forces(self, rest: NDArray[np.float64], cells: NDArray[np.int32]) -> NDArray[np.float64]:
        """Return the weight at each vertex, (n, 3) [N], integrated exactly for trilinear cells.

        ``rest`` (n, 3) [m] are the undeformed vertices, ``cells`` (m, c) their ids in each cell.
        """
        share = corner_volumes(rest, cells, self.filling)
        forces = _collect(len(rest), cells, (self.density[:, None] * share)[..., None] * self.acceleration)
        for item in self.attached:
            forces += item.forces(len(rest), self.acceleration)
        return forces


@dataclass(frozen=True, eq=False, kw_only=True)
class PointLoad:
    """A force at a material point.

    Attributes:
        name: name, unique among the actuators and loads of the scene.
        point: the single material point at which the force acts.
        force: (3,) force [N], finite.
    """

    name: str
    point: Embedding
    force: NDArray[np.float64]

    def __post_init__(self) -> None:
        _require_finite(self.name, "force", self.force)

    def forces(self, rest: NDArray[np.float64], cells: NDArray[np.int32]) -> NDArray[np.float64]:
        """Return the force at each vertex, (n, 3) [N]; ``rest`` (n, 3) [m] are the undeformed vertices."""
        return _collect(len(rest), self.point.corners, self.point.weights[..., None] * self.force)


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceLoad:
    """A traction on faces: a force per undeformed area.

    Attributes:
        name: name, unique among the actuators and loads of the scene.
        quads: int32 vertex ids of the faces, (q, 4), or (q, 6) for tetrahedra. If ``points`` are given, indices (q, 4)
            of these points; a triangle repeats its last corner.
        traction: (3,) traction [Pa], finite.
        points: material points as corners of the faces; None if the corners are vertices.
    """

    name: str
    quads: NDArray[np.int32]
    traction: NDArray[np.float64]
    points: Embedding | None = None

    def __post_init__(self) -> None:
        _require_finite(self.name, "traction", self.traction)

    def forces(self, rest: NDArray[np.float64], cells: NDArray[np.int32]) -> NDArray[np.float64]:
        """Return the force at each vertex, (n, 3) [N]; ``rest`` (n, 3) [m] are the undeformed vertices."""
        places = rest if self.points is None else self.points.at(rest)
        pulls = _collect(len(places), self.quads, corner_areas(places, self.quads)[..., None] * self.traction)
        if self.points is None:
            return pulls
        return _collect(len(rest), self.points.corners, self.points.weights[..., None] * pulls[:, None])


@dataclass(frozen=True, eq=False, kw_only=True)
class PressureLoad:
    """A follower pressure: it acts along the normals of faces as they move, on their deformed area.

    Attributes:
        name: name, unique among the actuators and loads of the scene.
        quads: int32 vertex ids of the faces, (q, 4), or (q, 6) for tetrahedra; normals point into the material.
        pressure: pressure [Pa], finite; positive pushes into the material.
    """

    name: str
    quads: NDArray[np.int32]
    pressure: float

    def __post_init__(self) -> None:
        if not np.isfinite(self.pressure):
            raise ValueError(f"load {self.name!r}: pressure must be a finite number, got {self.pressure!r}")


Load = Gravity | PointLoad | SurfaceLoad | PressureLoad


def corner_volumes(
    rest: NDArray[np.float64], cells: NDArray[np.int32], filling: Filling | None = None
) -> NDArray[np.float64]:
    """Return the integral of each node's shape function over each cell, (m, c) [m^3], by the rule of `gauss_points`."""
    return sum(volume[:, None] * shape for volume, shape in gauss_points(rest, cells, filling))


def gauss_points(
    rest: NDArray[np.float64], cells: NDArray[np.int32], filling: Filling | None = None
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Yield, for each integration point, its volume in each cell (m,) [m^3] and the shape functions there (1 or m, c).

    A hexahedron has 2 x 2 x 2 Gauss points. In a partly filled cell they are the points of its box, and their volumes
    add up to the volume of its material. A quadratic tetrahedron has 27 points, so that the mass of a tetrahedron with
    straight edges is exact.
    """
    corners = rest[cells]
    if cells.shape[1] == 10:
        yield from _tet_points(corners)
        return
    for point in GAUSS * CORNERS:
        volume = np.linalg.det(np.einsum("eai,aj->eij", corners, trilinear_slopes(point)))
        if filling is None:
            yield volume, trilinear_weights(point)[None]
        else:
            yield filling.share * volume, trilinear_weights(filling.points(point[None])[:, 0])


def _tet_points(nodes: NDArray[np.float64]) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Yield the volumes and shape functions of `gauss_points` for tetrahedra with ``nodes`` (m, 10, 3) [m]."""
    for place, weight in zip(*simplex_rule(TET_ORDER), strict=True):
        volume = np.linalg.det(np.einsum("eai,aj->eij", nodes, quadratic_slopes(place))) / 6.0
        yield weight * volume, quadratic_weights(place)[None]


def corner_areas(rest: NDArray[np.float64], quads: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return the integral of each node's shape function over each face [m^2], in the shape of ``quads``.

    Bilinear quads (q, 4) have 2 x 2 Gauss points. For six-node faces (q, 6) see `node_areas`.
    """
    if quads.shape[1] == 6:
        return node_areas(rest, quads)
    signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    corners = rest[quads]
    areas = np.zeros(quads.shape)
    for point in GAUSS * signs:
        factors = 1.0 + signs * point
        first = np.einsum("a,qai->qi", 0.25 * signs[:, 0] * factors[:, 1], corners)
        second = np.einsum("a,qai->qi", 0.25 * signs[:, 1] * factors[:, 0], corners)
        areas += np.linalg.norm(np.cross(first, second), axis=1)[:, None] * 0.25 * factors.prod(axis=1)
    return areas


def _require_finite(name: str, what: str, value: NDArray[np.float64]) -> None:
    if not np.isfinite(value).all():
        raise ValueError(f"load {name!r}: {what} must be three finite numbers, got {np.asarray(value).tolist()}")


def _collect(count: int, owners: NDArray[np.int32], forces: NDArray[np.float64]) -> NDArray[np.float64]:
    total = np.zeros((count, 3))
    np.add.at(total, owners.ravel(), forces.reshape(-1, 3))
    return total


def total_gravity(loads: Iterable[Load], commands: Mapping[str, float]) -> NDArray[np.float64]:
    """Return the total acceleration (3,) [m/s^2] of all gravity loads, at load factors ``commands``."""
    weights = (commands[load.name] * load.acceleration for load in loads if isinstance(load, Gravity))
    return sum(weights, start=np.zeros(3))

# SPDX-License-Identifier: Apache-2.0
"""Trials to reduce the excessive stiffness of confined rubber: other pressure fields and other mean gradients.

They use the linear problem: the stiffness of this solver's undeformed elements, with another volume term or another
mean gradient.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np
import scipy.sparse as sparse

from benchmarks.coarse_meshes.linear import displaced
from benchmarks.coarse_meshes.problem import YOUNG, Array, Problem
from benchmarks.coarse_meshes.problems import AROUND, PROBLEMS, SLENDERNESS, WIDTH
from gdfe_ros.materials import Linear
from gdfe_ros.materials.table import BULK, PENALTY, SHEAR
from gdfe_ros.mesh.faces import HEX_FACES
from gdfe_ros.mesh.trilinear import CORNERS
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.response import Watch
from gdfe_ros.solver.minimise.level import ElementStiffness

Matrix = Any
"""A sparse matrix of scipy."""
COLUMNS = (("pad", 2), ("pad", 4), ("tube", 2), ("tube", 4), ("bending, nu 0.495", 2), ("torsion", 2))
"""Problems and numbers of cells across on which the trials are compared."""


@dataclass(frozen=True, eq=False)
class Elements:
    """The parts of the stiffness of this solver's undeformed elements.

    Attributes:
        body: body with the elements.
        lattice: number of cells along each axis of the mesh; the index along the first axis changes fastest.
    """

    body: Body
    lattice: tuple[int, int, int]

    @classmethod
    def of(cls, name: str, across: int, problem: Problem) -> Elements:
        """Return the elements of a problem."""
        mesh, law = problem.mesh, Linear(young=YOUNG, poisson=problem.poisson)
        body = Body.build(mesh.vertices, mesh.cells, [law], np.zeros(mesh.n_cells, np.int32), ())
        bars = (SLENDERNESS * across, across, across)
        lattices = {"pad": (WIDTH * across, WIDTH * across, across), "tube": (across, AROUND * across, 1)}
        return cls(body, lattices.get(name, bars))

    @property
    def moduli(self) -> tuple[float, float, float]:
        """Shear modulus, bulk modulus, and the part of the bulk modulus that is not replaced by pressures [Pa]."""
        shear, bulk, kept = self.body.table.parameters[0, [SHEAR, BULK, PENALTY]]
        return float(shear), float(bulk), float(kept)

    @cached_property
    def gradient(self) -> list[Matrix]:
        """Operators (m, n) from a field on the vertices to its mean derivatives in the cells along x, y and z."""
        return self.summed(self.body.shape.gradient)

    @cached_property
    def hourglass(self) -> Matrix:
        """Hourglass stiffness (3 n, 3 n) [N/m]: that of displacements whose mean gradient is zero."""
        body = self.body
        none, ones = np.zeros(len(body.material)), np.ones(len(body.material))
        rest = SimpleNamespace(shape=body.shape, blocks=body.blocks, material=body.material, table=body.table)
        rest.pressure, rest.scale, rest.watch = none, ones, Watch.over(len(ones))
        tangents = ElementStiffness(len(body.cells)).at(rest, body.rest)
        freedom = (3 * body.cells[:, :, None] + np.arange(3)).reshape(-1, 24)
        rows, columns = np.repeat(freedom, 24, axis=1).ravel(), np.tile(freedom, (1, 24)).ravel()
        whole = sparse.csr_matrix((tangents.ravel(), (rows, columns)), shape=2 * (body.rest.size,))
        shear, _, kept = self.moduli
        return whole - self.distortion(self.gradient, shear) - self.volume(self.gradient, kept)

    def summed(self, weights: Array) -> list[Matrix]:
        """Return three operators (m, n) from vertices to cells, one per component of the corner weights (m, 8, 3)."""
        rows = np.repeat(np.arange(len(self.body.cells)), 8)
        shape = (len(self.body.cells), len(self.body.rest))
        return [
            sparse.csr_matrix((weights[..., k].ravel(), (rows, self.body.cells.ravel())), shape=shape) for k in range(3)
        ]

    def divergence(self, gradient: Sequence[Matrix]) -> Matrix:
        """Return the operator (m, 3 n) from displacements to the mean divergence in each cell."""
        return sum(_along(gradient[k], k) for k in range(3))

    def volume(self, gradient: Sequence[Matrix], bulk: float, patch: Matrix | None = None) -> Matrix:
        """Return the stiffness (3 n, 3 n) for a bulk modulus and the divergence of cells or of patches (p, m)."""
        divergence, size = self.divergence(gradient), sparse.diags(self.body.shape.volume)
        if patch is not None:
            volumes = np.asarray((patch @ size).sum(axis=1)).ravel()
            divergence, size = sparse.diags(1.0 / volumes) @ patch @ size @ divergence, sparse.diags(volumes)
        return bulk * divergence.T @ size @ divergence

    def distortion(self, gradient: Sequence[Matrix], shear: float) -> Matrix:
        """Return the stiffness (3 n, 3 n) for a shear modulus and the deviatoric mean strain."""
        volume, mean = sparse.diags(shear * self.body.shape.volume), self.divergence(gradient) / 3.0
        total = 0.0
        for i in range(3):
            normal = _along(gradient[i], i) - mean
            angle = _along(gradient[i], (i + 1) % 3) + _along(gradient[(i + 1) % 3], i)
            total = total + 2.0 * normal.T @ volume @ normal + angle.T @ volume @ angle
        return total


def _along(operator: Matrix, axis: int) -> Matrix:
    """Convert an operator (m, n) on scalar fields to (m, 3 n): it acts on the displacement component along an axis."""
    vertices = np.arange(operator.shape[1])
    pick = sparse.csr_matrix(
        (np.ones(len(vertices)), (vertices, 3 * vertices + axis)), shape=(len(vertices), 3 * len(vertices))
    )
    return operator @ pick


def as_shipped(elements: Elements) -> Matrix:
    """Return the stiffness with one pressure per cell."""
    shear, bulk, _ = elements.moduli
    gradient = elements.gradient
    return elements.hourglass + elements.distortion(gradient, shear) + elements.volume(gradient, bulk)


def over_patches(elements: Elements) -> Matrix:
    """Return the stiffness with one pressure per patch of 2 x 2 x 2 cells."""
    count = np.unravel_index(np.arange(len(elements.body.cells)), elements.lattice[::-1])
    _, patch = np.unique(np.stack(count) // 2, axis=1, return_inverse=True)
    return _pressures(elements, sparse.csr_matrix((np.ones(patch.size), (patch.ravel(), np.arange(patch.size)))))


def at_vertices(elements: Elements) -> Matrix:
    """Return the stiffness with a pressure at each vertex, from the mean volume of its cells (Bonet and Burton)."""
    cells = elements.body.cells
    share = np.full(cells.size, 0.125)
    return _pressures(elements, sparse.csr_matrix((share, (cells.ravel(), np.repeat(np.arange(len(cells)), 8)))))


def _pressures(elements: Elements, patch: Matrix) -> Matrix:
    """Return the stiffness with one pressure for each patch (p, m); the cells keep the rest of the bulk modulus."""
    shear, bulk, kept = elements.moduli
    gradient = elements.gradient
    own = elements.hourglass + elements.distortion(gradient, shear) + elements.volume(gradient, kept)
    return own + elements.volume(gradient, bulk - kept, patch)


def linear_in_cells(elements: Elements) -> Matrix:
    """Return the stiffness with a linear pressure in each cell, which resists the divergence of the bending modes."""
    body, (_, bulk, _) = elements.body, elements.moduli
    shape, total = body.shape, as_shipped(elements)
    rate = 2.0 / shape.edge_lengths * 8.0**-0.5
    for i, j in ((0, 1), (1, 2), (2, 0)):
        # Modes j of u_i and i of u_j vary over the third axis; each is a normal strain along its own.
        slope = 0.0
        for along, mode in ((i, j), (j, i)):
            weights = np.einsum("ea,ek,e->eak", shape.hourglass[:, mode], shape.edge_axes[:, along], rate[:, along])
            slope = slope + elements.divergence(elements.summed(weights))
        total = total + bulk / 3.0 * slope.T @ sparse.diags(shape.volume) @ slope
    return total


def curved_faces(elements: Elements) -> Matrix:
    """Return the stiffness with mean gradients from curved faces, whose curvature comes from second differences."""
    body, (shear, bulk, _) = elements.body, elements.moduli
    faces = _face_gradients(body.rest, body.cells) / body.shape.volume[None, :, None, None]
    same = sparse.identity(len(body.rest))
    second = [_second_difference(elements, axis) for axis in range(3)]
    gradient = [0.0, 0.0, 0.0]
    for axis in range(3):
        # The trapezoidal rule over a face misses a twelfth of the second differences along it.
        curved = same - (second[axis - 1] + second[axis - 2]) / 12.0
        gradient = [sum_ + part @ curved for sum_, part in zip(gradient, elements.summed(faces[axis]), strict=True)]
    # The undeformed cell is curved in the same manner. Relative to this shape, linear fields have exact gradients.
    inverse = np.linalg.inv(np.stack([part @ body.rest for part in gradient], axis=2))
    gradient = [sum(sparse.diags(inverse[:, j, k]) @ gradient[j] for j in range(3)) for k in range(3)]
    return elements.hourglass + elements.distortion(gradient, shear) + elements.volume(gradient, bulk)


def _face_gradients(rest: Array, cells: Array) -> Array:
    """Return the cell volume times the mean gradient as contributions (3, m, 8, 3) of the two faces along each axis."""
    found = np.zeros((3, len(cells), 8, 3))
    for face, corners in enumerate(HEX_FACES):
        quads = rest[cells[:, corners]]
        for s, t in CORNERS[:4, :2] / np.sqrt(3.0):
            weights = 0.25 * np.array([(1 - s) * (1 - t), (1 + s) * (1 - t), (1 + s) * (1 + t), (1 - s) * (1 + t)])
            along = 0.25 * np.array([[t - 1, 1 - t, 1 + t, -1 - t], [s - 1, -1 - s, 1 + s, 1 - s]])
            first, other = np.einsum("da,eai->dei", along, quads)
            found[face // 2][:, corners] += weights[None, :, None] * np.cross(first, other)[:, None]
    return found


def _second_difference(elements: Elements, axis: int) -> Matrix:
    """Return the operator (n, n) of second differences along an axis; end vertices take their neighbours' values."""
    cells, count = elements.body.cells, len(elements.body.rest)
    after, before = np.full(count, -1), np.full(count, -1)
    for low in np.flatnonzero(CORNERS[:, axis] < 0.0):
        opposite = CORNERS[low] + 2.0 * np.eye(3)[axis]
        high = int(np.flatnonzero((opposite == CORNERS).all(axis=1))[0])
        after[cells[:, low]], before[cells[:, high]] = cells[:, high], cells[:, low]
    middle = np.where(after < 0, before, np.where(before < 0, after, np.arange(count)))
    rows = np.flatnonzero((after[middle] >= 0) & (before[middle] >= 0))
    columns = np.stack([before[middle[rows]], middle[rows], after[middle[rows]]])
    values = np.repeat([1.0, -2.0, 1.0], len(rows))
    return sparse.csr_matrix((values, (np.tile(rows, 3), columns.ravel())), shape=(count, count))


WAYS: dict[str, Callable[[Elements], Matrix]] = {
    "as it is: a pressure in each cell": as_shipped,
    "pressures over patches of 2 x 2 x 2 cells": over_patches,
    "pressures at vertices": at_vertices,
    "pressures linear in each cell": linear_in_cells,
    "mean gradients from curved faces": curved_faces,
}
"""Dict from the name of a trial to the function that returns its stiffness."""


def trial(way: str, name: str, across: int) -> float:
    """Return the error of a trial on a problem, as a fraction."""
    problem = PROBLEMS[name](across)
    stiffness = WAYS[way](Elements.of(name, across, problem)).tocsr()
    forces = np.zeros(problem.mesh.vertices.size) if problem.forces is None else problem.forces.ravel()
    moved = displaced(stiffness, *problem.prescribed(), forces)
    pull = stiffness @ moved - forces
    return problem.measure(problem.found(moved.reshape(-1, 3), pull.reshape(-1, 3))) - 1.0


def all_trials() -> dict[str, list[float]]:
    """Return the errors of every trial, in the order of `COLUMNS`."""
    return {way: [trial(way, name, across) for name, across in COLUMNS] for way in WAYS}

# SPDX-License-Identifier: Apache-2.0
"""Contact points as stencils, and the forces that they hold during a step of the minimisation.

A contact point is a set of vertices with weights that moves relative to a surface: a plane, a shape, a face or an edge,
of an obstacle, a rigid body or the body itself. Its gap g has the gradient n, and its slip s lies in the plane across
n. It holds a normal force l n and a friction force -t. Before each step of the minimisation, `complementarity` finds
the forces with which the step keeps the laws of Signorini and Coulomb. While the step is made, the forces are constant
vectors on the vertices: the term is the potential of dead loads, sum_a (t w_a' - l n w_a) . x_a, with the weights w of
the gap and w' of the slip. Before the next step, they turn with the surfaces.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.materials.tensor import perpendicular
from gdfe_ros.mesh.triples import cross, dot, unit
from gdfe_ros.solver.terms.term import as_arrays, term_kernel

LOADS = 6
"""Numbers of a vertex among the loads: the gradient of its dead load [N], and a position [m] where its energy is 0, so
that energies are as small as steps.
"""


class Stencils(NamedTuple):
    """The contact points, or pairs, that are near.

    Attributes:
        places: (k, 3) [m] gap, and slip along two tangents.
        axes: (k, 3, 3) gradient of the gap, and the tangents.
        held: (k, 3) [N] present forces along these axes.
        shears: (k, 3) [N] vectors t of the friction forces -t.
        soft: (k,) [m/N] compliance of the spring through which the normal force acts.
        anchors: (k, 3) [m] places where slips begin, in the frame of what is touched.
        planes: (k, 4) planes n . q = d in this frame that replace the surface; n = 0 stands for none, but for `PLANES`.
        fixed: (k,) whether a plane holds wherever the point leaves.
        offsets: (k,) [m] subtracted from the distances.
        ends: (k, c) vertices that move the point relative to what it touches.
        pressing, rubbing: (k, c) weights of these vertices in the displacements that change the gap, and the slip.
    """

    places: NDArray[np.float64]
    axes: NDArray[np.float64]
    held: NDArray[np.float64]
    shears: NDArray[np.float64]
    soft: NDArray[np.float64]
    anchors: NDArray[np.float64]
    planes: NDArray[np.float64]
    fixed: NDArray[np.bool_]
    offsets: NDArray[np.float64]
    ends: NDArray[np.int32]
    pressing: NDArray[np.float64]
    rubbing: NDArray[np.float64]

    @classmethod
    def unwritten(cls, presses: NDArray[np.float64], *others: NDArray) -> Self:
        """Return stencils of points with normal forces (k,) [N] and ``others``, the arrays from `shears` on.

        Places, axes and the friction forces along them are not written yet.
        """
        count = len(presses)
        held = np.zeros((count, 3))
        held[:, 0] = presses
        return cls(np.empty((count, 3)), np.empty((count, 3, 3)), held, *others)

    @classmethod
    def join(cls, parts: Sequence[Stencils], width: int) -> Self:
        """Return the stencils of all ``parts``, with ``width`` ends; those that are added have no weight."""
        every = list(zip(NOTHING_NEAR, *parts, strict=True))
        return cls(*map(np.concatenate, every[:-3]), *(pad_columns(columns, width) for columns in every[-3:]))

    @property
    def slips(self) -> NDArray[np.float64]:
        """Slips (k, 3) [m]."""
        return np.einsum("ka,kai->ki", self.places[:, 1:], self.axes[:, 1:])

    @property
    def normals(self) -> NDArray[np.float64]:
        """Unit normals (k, 3); zero where the gap has no gradient."""
        length = np.linalg.norm(self.axes[:, 0], axis=1, keepdims=True)
        return self.axes[:, 0] / np.where(length > 0.0, length, 1.0)


NOTHING_NEAR = Stencils.unwritten(
    *(np.zeros(0), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 4)), np.zeros(0, np.bool_)),
    *(np.zeros(0), np.zeros((0, 1), np.int32), *np.zeros((2, 0, 1))),
)
"""The stencils of no points."""


def pad_columns(parts: Sequence[NDArray], width: int) -> NDArray:
    """Return the rows of all ``parts`` (k, c, ...), filled up to ``width`` columns with the first index, or 0."""
    kind = parts[0].dtype.kind
    found, first = np.zeros((sum(map(len, parts)), width, *parts[0].shape[2:]), parts[0].dtype), 0
    for part in parts:
        own = found[first : first + len(part)]
        own[:, : part.shape[1]] = part
        if kind == "i":
            own[:, part.shape[1] :] = part[:, :1]
        first += len(part)
    return found


@internal
def set_axes(i, gap, gradient, slip, stencils):
    """Write place, axes and held force of a point with a gap, its gradient and a slip; its vector t is turned.

    The normal force stays as it is.
    """
    places, axes, held, shears = stencils.places, stencils.axes, stencils.held, stencils.shears
    normal = unit(gradient)
    first = perpendicular(normal)
    second = cross(normal, first)
    t = shears[i, 0], shears[i, 1], shears[i, 2]
    places[i, 0], places[i, 1], places[i, 2] = gap, dot(first, slip), dot(second, slip)
    held[i, 1], held[i, 2] = -dot(first, t), -dot(second, t)
    for j in range(3):
        axes[i, 0, j], axes[i, 1, j], axes[i, 2, j] = gradient[j], first[j], second[j]
    turn_shear(i, stencils)


@internal
def turn_shear(i, stencils):
    """Write the vector t of a point's friction force, which is along the tangents."""
    held, axes = stencils.held, stencils.axes
    for j in range(3):
        stencils.shears[i, j] = -(held[i, 1] * axes[i, 1, j] + held[i, 2] * axes[i, 2, j])


@internal
def add_load(stencils, i, loads):
    """Add the gradients of a point's dead loads to ``loads`` (n, 6), those of all vertices."""
    axes, held = stencils.axes, stencils.held
    for a in range(stencils.ends.shape[1]):
        vertex, w, v = stencils.ends[i, a], stencils.pressing[i, a], stencils.rubbing[i, a]
        for j in range(3):
            rubs = held[i, 1] * axes[i, 1, j] + held[i, 2] * axes[i, 2, j]
            loads[vertex, j] -= w * held[i, 0] * axes[i, 0, j] + v * rubs


@kernel
def add_loads(stencils, loads):
    """Do `add_load` for all points."""
    for i in range(len(stencils.ends)):
        add_load(stencils, i, loads)


@kernel
def held_energy(x, reals, integers, force, size):
    """Return the energy [J] of the dead loads; add its gradient to ``force``. See `term_kernel`.

    ``reals`` are the loads of all vertices, and ``integers`` 1 if any acts, else 0.
    """
    energy = 0.0
    if integers[0] == 0:
        return energy
    for v in range(len(x)):
        first = LOADS * v
        for j in range(3):
            force[v, j] += reals[first + j]
            work = reals[first + j] * (x[v, j] - reals[first + 3 + j])
            energy += work
            size[0] += abs(work)
    return energy


@term_kernel
def held_entry(x, n, reals, k, integers, i, force, size):
    """Call `held_energy` with the raw pointers that the terms' kernels receive."""
    return held_energy(*as_arrays(x, n, reals, k, integers, i, force, size))

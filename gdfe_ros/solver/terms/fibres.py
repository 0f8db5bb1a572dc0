# SPDX-License-Identifier: Apache-2.0
"""Layers of fibres as terms.

A layer consists of fibre points on faces. The energy of a point with area A is k A / 2 e^2, with the layer's stiffness
k and the Green strain e = (d . d - 1) / 2. The present fibre vector d is linear in the positions of the face's nodes
(`gdfe_ros.mesh.cells.face_fibres`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gdfe_ros.compiled import kernel
from gdfe_ros.materials.tensor import scale_vector
from gdfe_ros.mesh.cells.face_fibres import FibreLayer
from gdfe_ros.mesh.triples import dot
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.matrix.constant_matrix import scatter
from gdfe_ros.solver.terms.term import Term, as_arrays, share, term_kernel, weighted
from gdfe_ros.solver.vectors import Array

NODES, POINTS, SLACK, HEAD = range(4)
"""Offsets in ``integers``: nodes of a face, points of a face, whether compressed fibres are slack; then the nodes of
all faces. In ``reals``, each point has its k A [N m] and then the factors of the nodes [1/m]."""


@kernel
def fibre_energy(x, reals, integers, force, size):
    """Return the energy [J] of a layer of fibres and add its gradient; `term_kernel` needs this signature."""
    nodes, points, slack, energy, start = integers[NODES], integers[POINTS], integers[SLACK], 0.0, 0
    for face in range((len(integers) - HEAD) // nodes):
        for _ in range(points):
            d = weighted(x, integers, HEAD + face * nodes, reals, start + 1, nodes)
            strain = 0.5 * (dot(d, d) - 1.0)
            if strain > 0.0 or not slack:
                pull = reals[start] * strain
                energy += 0.5 * pull * strain
                share(force, integers, HEAD + face * nodes, reals, start + 1, nodes, scale_vector(d, pull))
            start += 1 + nodes
    size[0] += energy
    return energy


@term_kernel
def _entry(x, n, reals, k, integers, i, force, size):
    return fibre_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


class FibreTerm(Term):
    """A layer of fibres.

    Args:
        layer: the layer.
        body: the body that carries it.
    """

    ONSET = -1e-6
    """A slack fibre whose strain is above this counts as taut in the tangent. The tangent only speeds up the
    minimisation.
    """

    kernel = _entry

    def __init__(self, layer: FibreLayer, body: Body) -> None:
        self._layer, self._count = layer, len(body.rest)
        self.exact = not layer.compression
        faces = layer.families[0].faces
        self._factors = np.concatenate([family.factors for family in layer.families], axis=1)
        self._springs = layer.stiffness * np.concatenate([family.areas for family in layer.families], axis=1)
        head = np.array([faces.shape[1], self._springs.shape[1], not layer.compression], dtype=np.int32)
        reals = np.concatenate([self._springs[..., None], self._factors], axis=2)
        super().__init__(layer.name, reals.ravel(), np.concatenate([head, faces.ravel()]))

    @property
    def _faces(self) -> NDArray[np.int32]:
        return self.integers[HEAD:].reshape(-1, self.integers[NODES])

    def stiffness(self) -> sparse.csc_matrix:
        """Return the layer's stiffness (n, n) [N/m] for undeformed taut fibres; it acts on x, y and z alike."""
        blocks = np.einsum("fp,fpa,fpb->fab", self._springs, self._factors, self._factors)
        return scatter(blocks, self._faces, self._count).tocsc()

    def couplings(self) -> NDArray[np.int32]:
        """Return the nodes of the faces (f, c)."""
        return self._faces

    def tangents(self, positions: Array) -> Array:
        """Return the stiffness of each face at ``positions`` (n, 3) [m], (f, 3 c, 3 c) [N/m].

        With the symbols of the module, a taut fibre point adds k A (d d^T + max(e, 0) I), distributed to the c nodes of
        its face. A slack fibre point adds nothing.
        """
        vectors, strains = self._strain(positions)
        taut = self._springs * (self._layer.compression | (strains > self.ONSET))
        inner = vectors[..., :, None] * vectors[..., None, :] + np.maximum(strains, 0.0)[..., None, None] * np.eye(3)
        spread = np.einsum("fp,fpa,fpij,fpb->faibj", taut, self._factors, inner, self._factors, optimize=True)
        return spread.reshape(len(spread), 3 * self._factors.shape[2], -1)

    def report(self, positions: Array) -> dict[str, float]:
        """Return the largest ``stretch`` of a fibre, and the largest ``force`` per undeformed width [N/m]."""
        _, strains = self._strain(positions)
        stretch = np.sqrt(1.0 + 2.0 * strains)
        pulled = np.maximum(strains, 0.0) if not self._layer.compression else strains
        return {"stretch": float(stretch.max()), "force": float((self._layer.stiffness * pulled * stretch).max())}

    def _strain(self, positions: Array) -> tuple[Array, Array]:
        """Return the present fibre vectors (f, p, 3) and their Green strains (f, p)."""
        vectors = np.einsum("fpa,fai->fpi", self._factors, positions[self._faces])
        return vectors, 0.5 * (np.einsum("fpi,fpi->fp", vectors, vectors) - 1.0)

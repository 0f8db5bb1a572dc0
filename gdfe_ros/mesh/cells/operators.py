# SPDX-License-Identifier: Apache-2.0
"""Shape operators of hexahedra, computed once: mean gradient, hourglass vectors, edges (docs/theory/energy.md)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.cells.filling import CORNERS, MODES, Filling, trilinear_slopes

PARALLEL = 1e-9
"""An element counts as a parallelepiped if its hourglass amplitude divided by its shortest edge is at most this."""


class ShapeOperators(NamedTuple):
    """Constant operators of every element.

    Attributes:
        cells: (m, 8) int32 corner vertices, VTK order.
        volume: (m,) float64 [m^3] of the material.
        gradient: (m, 8, 3) float64 [1/m], exact volume average g_a of the trilinear gradients (Flanagan and Belytschko
            1981). The mean deformation gradient is F = sum_a x_a (x) g_a.
        hourglass: (m, 4, 8) float64, vectors gamma_k orthogonal to every linear field, of unit length in whole cells.
        edge_axes: (m, 3, 3) float64, row i is the unit direction of dX/dxi_i at the undeformed element's centre.
        edge_lengths: (m, 3) float64 [m], 2 |dX/dxi_i| at the centre: length of the mean edge vector along xi_i.
        reference: (m, 3, 3) float64 [1/m], inverse of dX/dxi at the element's centre.
        parallel: (m,) bool, whether the element is a whole parallelepiped, for which cheaper formulas hold.
        corner_ratio: (m, 8) float64 [1/m^3], inverse of the triple product of the three edges at each corner.
        cut: (m,) bool, whether the element is a box inside its cell; `corner_ratio` then refers to the box's corners.
        box: (m, 3, 2) float64, start and end of this box along each edge of its cell, as fractions of the edge; 0 and 1
            in whole cells.
        across: (m,) int32, number of cells across the section that contains the element, for its torsional stiffness;
            1 if the section is a single cell.
    """

    cells: NDArray[np.int32]
    volume: NDArray[np.float64]
    gradient: NDArray[np.float64]
    hourglass: NDArray[np.float64]
    edge_axes: NDArray[np.float64]
    edge_lengths: NDArray[np.float64]
    reference: NDArray[np.float64]
    parallel: NDArray[np.bool_]
    corner_ratio: NDArray[np.float64]
    cut: NDArray[np.bool_]
    box: NDArray[np.float64]
    across: NDArray[np.int32]


def shape_operators(
    vertices: NDArray[np.float64], cells: NDArray[np.int32], filling: Filling | None = None
) -> ShapeOperators:
    """Return the operators of all elements from undeformed vertices (n, 3) [m] and cells (m, 8).

    The volume and the mean gradient are integrated with 2 x 2 x 2 Gauss points, exact for trilinear shapes. The
    operators of a cut cell are those of its box in ``filling``, expressed in terms of the cell's corners.
    """
    corners = vertices[cells]
    shape = _operators(corners, cells)
    if filling is None or len(filling.cut) == 0:
        return shape
    cut, weights = filling.cut, filling.boxes
    box = _operators(np.einsum("kba,kai->kbi", weights, corners[cut]), cells[cut])
    shape.volume[cut] *= filling.share[cut]
    shape.gradient[cut] = np.einsum("kba,kbi->kai", weights, box.gradient)
    shape.hourglass[cut] = np.einsum("kba,kmb->kma", weights, box.hourglass)
    shape.edge_axes[cut], shape.edge_lengths[cut] = box.edge_axes, box.edge_lengths
    shape.reference[cut], shape.parallel[cut] = box.reference, False
    shape.corner_ratio[cut], shape.cut[cut] = box.corner_ratio, True
    sides = filling.spread[cut, :, None] * np.array([-1.0, 1.0])
    shape.box[cut] = 0.5 * (1.0 + filling.centre[cut, :, None] + sides)
    return shape


def _operators(corners: NDArray[np.float64], cells: NDArray[np.int32]) -> ShapeOperators:
    """Return the operators of whole elements with ``corners`` (m, 8, 3) [m]."""
    volume = np.zeros(len(cells))
    weighted = np.zeros((len(cells), 8, 3))
    for point in CORNERS / np.sqrt(3.0):
        local = trilinear_slopes(point)
        jacobian = np.einsum("eai,aj->eij", corners, local)
        determinant = np.linalg.det(jacobian)
        volume += determinant
        weighted += np.einsum("aj,eji->eai", local, np.linalg.inv(jacobian)) * determinant[:, None, None]
    gradient = weighted / volume[:, None, None]
    edges = np.einsum("eai,aj->eji", corners, trilinear_slopes(np.zeros(3)))
    lengths = np.linalg.norm(edges, axis=2)
    bends = np.abs(np.einsum("ka,eai->eki", MODES, corners)).max(axis=(1, 2))
    products = 8.0 * np.linalg.det(np.einsum("eai,caj->ecij", corners, trilinear_slopes(CORNERS)))
    return ShapeOperators(
        np.ascontiguousarray(cells, dtype=np.int32),
        volume,
        np.ascontiguousarray(gradient),
        _hourglass_vectors(corners, gradient),
        np.ascontiguousarray(edges / lengths[:, :, None]),
        2.0 * lengths,
        np.ascontiguousarray(np.linalg.inv(edges.transpose(0, 2, 1))),
        bends <= PARALLEL * lengths.min(axis=1),
        np.ascontiguousarray(1.0 / products),
        np.zeros(len(cells), dtype=np.bool_),
        np.tile([0.0, 1.0], (len(cells), 3, 1)),
        np.ones(len(cells), dtype=np.int32),
    )


def _hourglass_vectors(corners: NDArray[np.float64], gradient: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the hourglass vectors (m, 4, 8) of Flanagan and Belytschko (1981).

    They are `MODES` minus their linear parts, scaled to unit length.
    """
    slopes = np.einsum("ka,eai->eki", MODES, corners)
    vectors = MODES - np.einsum("eki,eai->eka", slopes, gradient)
    return np.ascontiguousarray(vectors / np.linalg.norm(vectors, axis=2, keepdims=True))


def grow_operators(shape: ShapeOperators, cells: NDArray[np.intp], stretch: NDArray[np.float64]) -> ShapeOperators:
    """Return the operators after the rest shape of some cells is mapped by G.

    The gradients of such a cell become G^-T g_a, its volume becomes det G V, and its edges become G d. The hourglass
    vectors do not change under linear maps.

    Args:
        shape: operators without growth; they are not modified.
        cells: (k,) cells that grow.
        stretch: (k, 3, 3) their growth G, symmetric and positive definite.
    """
    inverse, ratio = np.linalg.inv(stretch), np.linalg.det(stretch)
    edges = np.einsum("eij,ekj->eki", stretch, (shape.edge_axes * shape.edge_lengths[..., None])[cells])
    lengths = np.linalg.norm(edges, axis=2)
    return shape._replace(
        volume=with_rows(shape.volume, cells, shape.volume[cells] * ratio),
        gradient=with_rows(shape.gradient, cells, shape.gradient[cells] @ inverse),
        edge_axes=with_rows(shape.edge_axes, cells, edges / lengths[..., None]),
        edge_lengths=with_rows(shape.edge_lengths, cells, lengths),
        reference=with_rows(shape.reference, cells, shape.reference[cells] @ inverse),
        corner_ratio=with_rows(shape.corner_ratio, cells, shape.corner_ratio[cells] / ratio[:, None]),
    )


def with_rows(array: NDArray[np.float64], rows: NDArray[np.intp], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a copy of ``array`` in which ``values`` replace the given ``rows``."""
    changed = array.copy()
    changed[rows] = values
    return changed

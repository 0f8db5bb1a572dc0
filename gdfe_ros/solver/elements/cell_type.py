# SPDX-License-Identifier: Apache-2.0
"""Cell types, and the functions that implement each of them.

A kernel that calls one of the functions in `CellKernels` is compiled once for each cell type. Numba infers the cell
type from the type of the operators, and inserts the function of that cell type, without a cost at run time. A third
cell type needs an entry in `KERNELS`, and a `CellType`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from gdfe_ros.compiled import INLINED
from gdfe_ros.materials.table import MaterialTable, with_local_share
from gdfe_ros.mesh.cells.faces import Faces, boundary_faces
from gdfe_ros.mesh.cells.operators import ShapeOperators, grow_operators, shape_operators
from gdfe_ros.mesh.cells.tet_operators import TetOperators, gradients, grow_tet_operators, tet_operators
from gdfe_ros.mesh.cells.tetrahedra import EDGES, PARTS, tet_boundary
from gdfe_ros.solver.elements import hexahedra, quadratic_tetrahedra
from gdfe_ros.solver.elements.blocks import Blocks, hex_geometry, make_blocks, tet_geometry
from gdfe_ros.solver.vectors import Array


class CellKernels(NamedTuple):
    """Compiled functions of a cell type; ``x`` (n, 3) are positions [m], ``e`` is an element, ``c`` its node count.

    Attributes:
        evaluate_blocks: writes node forces (m, c, 3) [N] and energies (m,) [J] of a range of blocks.
        load_points: writes the nodes (c, 3) [m] of ``e``, or of the box that the material of a cut cell fills.
        add_slopes: adds an energy's derivatives with respect to the points that `load_points` writes to the forces of
            ``e``.
        volume_ratio: current volume of ``e`` divided by its undeformed volume. The pressure of an element, if it has
            one, is the multiplier of this ratio.
    """

    evaluate_blocks: Callable
    load_points: Callable
    add_slopes: Callable
    volume_ratio: Callable


def _of(module) -> CellKernels:
    """Return the functions of ``module`` by name."""
    return CellKernels(*(getattr(module, name) for name in CellKernels._fields))


KERNELS = {ShapeOperators: _of(hexahedra), TetOperators: _of(quadratic_tetrahedra)}
"""The functions of each cell type, by the class of its operators."""


def _of_cell_type(name: str) -> Callable:
    """Return a function for kernels. It calls the function ``name`` of the cell type to which its arguments belong."""

    def call(*arguments):
        return getattr(_kernels([type(each) for each in arguments]), name)(*arguments)

    @overload(call, jit_options=INLINED)
    def _choose(*arguments):
        own = getattr(_kernels([getattr(kind, "instance_class", None) for kind in arguments]), name)
        return lambda *arguments: own(*arguments)

    return call


def _kernels(classes: list[type | None]) -> CellKernels:
    """Return the functions of the cell type whose class of operators is among ``classes``."""
    return next(KERNELS[each] for each in classes if each in KERNELS)


evaluate_blocks, load_points, add_slopes, volume_ratio = map(_of_cell_type, CellKernels._fields)


class CellType(NamedTuple):
    """A type of cells: hexahedra or tetrahedra.

    Attributes:
        corners: number of nodes c.
        operators: function that returns the constant operators for vertices (n, 3) [m], cells (m, c) and the filling of
            cut cells.
        table: function that returns the material table for the kernels of this type, from the packed material table.
        grown: function that returns the operators of grown rest shapes, from operators, cells (k,) and their growths
            (k, 3, 3).
        geometry: function that returns the rows of each element's geometry (m, g) for the kernels, from the operators.
        matrix_blocks: function that returns the blocks (m, c, c) [N/m] of the constant matrix, from operators, weights
            (m,) [Pa] and hourglass stiffnesses (m,) [N/m].
        tangents: compiled function that writes d(node force)/d(node position) (m, 3 c, 3 c) [N/m].
        softens: whether the hourglass stiffness depends on the strain.
        boundary: function that returns the outer faces of cells (m, c).
        edges: pairs of nodes of a cell that are neighbours on an edge.
        simple: (k, 8) nodes of the hexahedra that fill a cell; those of a tetrahedron have coincident corners.
    """

    corners: int
    operators: Callable
    table: Callable[[MaterialTable], MaterialTable]
    grown: Callable
    geometry: Callable[..., Array]
    matrix_blocks: Callable[..., Array]
    tangents: Callable
    softens: bool
    boundary: Callable[[NDArray[np.int32]], Faces]
    edges: tuple[tuple[int, int], ...]
    simple: NDArray[np.int32]

    def blocks(
        self,
        shape: ShapeOperators | TetOperators,
        material: NDArray[np.int32],
        table: MaterialTable,
        elements: NDArray[np.int32],
    ) -> Blocks:
        """Return the ``elements`` (k,) of a body with materials (m,) in the layout of the kernels."""
        parallel = getattr(shape, "parallel", np.zeros(len(material), dtype=bool))
        return make_blocks(self.geometry(shape), table.law[material], parallel, elements)


def _hex_matrix(shape: ShapeOperators, weight: Array, hourglass: Array) -> Array:
    """Return the elements' blocks of the constant matrix, w V g g^T + c sum_k gamma_k gamma_k^T, (m, 8, 8) [N/m].

    w is the ``weight`` (m,) [Pa], V the volume [m^3], g the gradient operators [1/m], c the ``hourglass`` stiffness
    (m,) [N/m], and gamma_k are the hourglass vectors.
    """
    blocks = np.einsum("e,eai,ebi->eab", weight * shape.volume, shape.gradient, shape.gradient)
    blocks += np.einsum("e,eka,ekb->eab", hourglass, shape.hourglass, shape.hourglass)
    return blocks


def _tet_matrix(shape: TetOperators, weight: Array, hourglass: Array) -> Array:
    """Return the elements' blocks of the constant matrix, w int g g^T dV; tetrahedra have no hourglass stiffness."""
    local = gradients(shape.inverse)
    return np.einsum("eg,egai,egbi->eab", weight[:, None] * shape.weight, local, local, optimize=True)


HEXAHEDRA = CellType(
    8,
    shape_operators,
    lambda table: table,
    grow_operators,
    hex_geometry,
    _hex_matrix,
    hexahedra.element_tangents,
    True,
    boundary_faces,
    ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)),
    np.arange(8, dtype=np.int32)[None],
)
TETRAHEDRA = CellType(
    10,
    lambda vertices, cells, filling=None: tet_operators(vertices, cells),
    with_local_share,
    grow_tet_operators,
    tet_geometry,
    _tet_matrix,
    quadratic_tetrahedra.element_tangents,
    False,
    tet_boundary,
    tuple((corner, middle) for middle, ends in enumerate(EDGES, start=4) for corner in ends),
    PARTS[:, [0, 1, 2, 2, 3, 3, 3, 3]],
)
CELL_TYPES = {kind.corners: kind for kind in (HEXAHEDRA, TETRAHEDRA)}
"""Cell types by the number of nodes of a cell."""


def cell_type_of(shape: ShapeOperators | TetOperators) -> CellType:
    """Return the cell type of element operators, by the number of nodes c of their ``cells`` (m, c)."""
    return CELL_TYPES[shape.cells.shape[1]]

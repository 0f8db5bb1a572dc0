# SPDX-License-Identifier: Apache-2.0
"""The functions outside of kernels that a cell type has to implement (the compiled ones: `elements.cell_kernels`)."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.materials.table import MaterialTable, with_local_share
from gdfe_ros.mesh.faces import Faces, boundary_faces
from gdfe_ros.mesh.operators import ShapeOperators, shape_operators
from gdfe_ros.mesh.tet_faces import tet_boundary
from gdfe_ros.mesh.tet_operators import TetOperators, gradients, tet_operators
from gdfe_ros.solver.elements import tangent_rows, tetrahedra
from gdfe_ros.solver.elements.blocks import make_blocks
from gdfe_ros.solver.elements.tet_blocks import make_tet_blocks


class CellType(NamedTuple):
    """A kind of cells.

    Attributes:
        noun: its name, plural.
        corners: number of nodes c.
        operators: function that returns the constant operators, from vertices (n, 3) [m], cells (m, c) and the filling
            of cut cells.
        blocks: function that returns elements in the layout of the kernels, from operators, materials (m,), their table
            and elements (k,).
        table: function that returns the table of materials for its kernels, from the table of the laws.
        matrix_blocks: function that returns the blocks (m, c, c) [N/m] of the constant matrix, from operators, weights
            (m,) [Pa] and hourglass stiffnesses (m,) [N/m].
        tangents: compiled function that writes d(node force)/d(node position) (m, 3 c, 3 c) [N/m].
        softens: whether hourglass stiffness follows the strain.
        boundary: function that returns the outer faces of cells (m, c).
    """

    noun: str
    corners: int
    operators: Callable
    blocks: Callable
    table: Callable[[MaterialTable], MaterialTable]
    matrix_blocks: Callable[..., NDArray[np.float64]]
    tangents: Callable
    softens: bool
    boundary: Callable[[NDArray[np.int32]], Faces]


def _hex_matrix(
    shape: ShapeOperators, weight: NDArray[np.float64], hourglass: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return w_e V_e g g^T + c_e sum_k gamma_k gamma_k^T, (m, 8, 8) [N/m].

    w is the ``weight`` [Pa], V the volume [m^3], g the gradient operators [1/m], c the ``hourglass`` stiffness
    [N/m].
    """
    blocks = np.einsum("e,eai,ebi->eab", weight * shape.volume, shape.gradient, shape.gradient)
    blocks += np.einsum("e,eka,ekb->eab", hourglass, shape.hourglass, shape.hourglass)
    return blocks


def _tet_matrix(
    shape: TetOperators, weight: NDArray[np.float64], hourglass: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return w_e int g g^T dV over the integration points; tetrahedra need no hourglass stiffness."""
    local = gradients(shape.inverse)
    return np.einsum("eg,egai,egbi->eab", weight[:, None] * shape.weight, local, local, optimize=True)


HEXAHEDRA = CellType(
    "hexahedra",
    8,
    shape_operators,
    make_blocks,
    lambda table: table,
    _hex_matrix,
    tangent_rows.element_tangents,
    True,
    boundary_faces,
)
TETRAHEDRA = CellType(
    "tetrahedra",
    10,
    lambda vertices, cells, filling=None: tet_operators(vertices, cells),
    make_tet_blocks,
    with_local_share,
    _tet_matrix,
    tetrahedra.element_tangents,
    False,
    tet_boundary,
)
_BY_CORNERS = {kind.corners: kind for kind in (HEXAHEDRA, TETRAHEDRA)}


def cell_type_of(shape: ShapeOperators | TetOperators) -> CellType:
    """Return the cell type of operators, or of anything else with ``cells`` (m, c)."""
    return _BY_CORNERS[shape.cells.shape[1]]


def cell_type_with(corners: int) -> CellType:
    """Return the cell type with this number of nodes."""
    return _BY_CORNERS[corners]

# SPDX-License-Identifier: Apache-2.0
"""The compiled functions that each cell type implements, and their selection by the type of the cell type's operators.

A kernel that calls one of the functions below is compiled once for each cell type. Numba sees the type of ``shape``,
and replaces the call by the function of that cell type, without a cost at run time. A third type needs an entry in
`KERNELS`, and one in `gdfe_ros.solver.elements.cell_type`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from numba.extending import overload

from gdfe_ros.mesh.operators import ShapeOperators
from gdfe_ros.mesh.tet_operators import TetOperators
from gdfe_ros.solver.elements import hexahedra, tetrahedra

_INLINED = {"nogil": True, "error_model": "numpy", "forceinline": True, "no_cpython_wrapper": True}


class CellKernels(NamedTuple):
    """Compiled functions of a cell type; ``x`` (n, 3) are positions [m], ``e`` is an element, ``c`` its node count.

    Attributes:
        evaluate_blocks: writes node forces (m, c, 3) [N] and energies (m,) [J] of a range of blocks.
        add_walls: adds the fold barriers of watched elements to these forces and energies.
        room: distance [m] that vertices may move before the barrier of ``e`` can act; 0 if ``e`` is nearly folded. The
            last argument of this function is scratch (8, 3).
        mean_gradient: volume average of the deformation gradient of ``e``.
        volume_ratio: current volume of ``e`` divided by its undeformed volume. If ``e`` has a pressure, it is the
            multiplier of this ratio.
        least_corners: writes the least det F over the corners of each of several elements; NaN if one is NaN.
    """

    evaluate_blocks: Callable
    add_walls: Callable
    room: Callable
    mean_gradient: Callable
    volume_ratio: Callable
    least_corners: Callable


def _of(module) -> CellKernels:
    """Return the functions of ``module`` by name."""
    return CellKernels(*(getattr(module, name) for name in CellKernels._fields))


KERNELS = {ShapeOperators: _of(hexahedra), TetOperators: _of(tetrahedra)}
"""The functions of each cell type, by the class of its operators."""


def _of_cell_type(name: str) -> Callable:
    """Return a function that calls `CellKernels` ``name`` of the cell type; numba replaces it in kernels."""

    def call(*arguments):
        return getattr(_kernels([type(each) for each in arguments]), name)(*arguments)

    @overload(call, jit_options=_INLINED)
    def _chosen(*arguments):
        own = getattr(_kernels([getattr(kind, "instance_class", None) for kind in arguments]), name)
        return lambda *arguments: own(*arguments)

    return call


def _kernels(classes: list[type | None]) -> CellKernels:
    """Return the functions of the cell type whose operators are among arguments of these classes."""
    return next(KERNELS[each] for each in classes if each in KERNELS)


evaluate_blocks, add_walls = _of_cell_type("evaluate_blocks"), _of_cell_type("add_walls")
room, least_corners = _of_cell_type("room"), _of_cell_type("least_corners")
mean_gradient, volume_ratio = _of_cell_type("mean_gradient"), _of_cell_type("volume_ratio")

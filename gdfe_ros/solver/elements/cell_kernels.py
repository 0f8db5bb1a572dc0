# SPDX-License-Identifier: Apache-2.0
"""The compiled functions that each cell type implements, and their selection by the type of the cell type's operators.

A kernel that calls one of the functions below is compiled once for each cell type. Numba sees the type of ``shape``,
and replaces the call by the function of that cell type, without a cost at run time. A third type needs an entry in
`KERNELS`, and one in `gdfe_ros.solver.elements.cell_type`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from numba import types
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


def evaluate_blocks(first, last, x, shape, blocks, material, pressure, scale, table, force, energy):
    """Call `CellKernels.evaluate_blocks` of the cell type. Numba replaces this function in kernels."""
    return KERNELS[type(shape)].evaluate_blocks(
        first, last, x, shape, blocks, material, pressure, scale, table, force, energy
    )


def add_walls(x, watched, shape, material, table, force, energy):
    """Call `CellKernels.add_walls` of the cell type. Numba replaces this function in kernels."""
    return KERNELS[type(shape)].add_walls(x, watched, shape, material, table, force, energy)


def room(x, shape, e, scratch):
    """Call `CellKernels.room` of the cell type. Numba replaces this function in kernels."""
    return KERNELS[type(shape)].room(x, shape, e, scratch)


def mean_gradient(x, shape, e):
    """Call `CellKernels.mean_gradient` of the cell type. Numba replaces this function in kernels."""
    return KERNELS[type(shape)].mean_gradient(x, shape, e)


def volume_ratio(x, shape, e):
    """Call `CellKernels.volume_ratio` of the cell type. Numba replaces this function in kernels."""
    return KERNELS[type(shape)].volume_ratio(x, shape, e)


def least_corners(x, shape, elements, out):
    """Call `CellKernels.least_corners` of the cell type. Numba replaces this function in kernels."""
    return KERNELS[type(shape)].least_corners(x, shape, elements, out)


def _own(shape: types.NamedTuple, name: str) -> Callable:
    return getattr(KERNELS[shape.instance_class], name)


@overload(evaluate_blocks, jit_options=_INLINED)
def _evaluate_blocks(first, last, x, shape, blocks, material, pressure, scale, table, force, energy):
    own = _own(shape, "evaluate_blocks")

    def chosen(first, last, x, shape, blocks, material, pressure, scale, table, force, energy):
        own(first, last, x, shape, blocks, material, pressure, scale, table, force, energy)

    return chosen


@overload(add_walls, jit_options=_INLINED)
def _add_walls(x, watched, shape, material, table, force, energy):
    own = _own(shape, "add_walls")

    def chosen(x, watched, shape, material, table, force, energy):
        own(x, watched, shape, material, table, force, energy)

    return chosen


def _measure(stub: Callable, name: str) -> None:
    """Let numba replace calls of ``stub`` (``x``, ``shape``, ``e``) by the function ``name`` of the cell type."""

    @overload(stub, jit_options=_INLINED)
    def _chosen(x, shape, e):
        own = _own(shape, name)
        return lambda x, shape, e: own(x, shape, e)


@overload(room, jit_options=_INLINED)
def _room(x, shape, e, scratch):
    own = _own(shape, "room")
    return lambda x, shape, e, scratch: own(x, shape, e, scratch)


@overload(least_corners, jit_options=_INLINED)
def _least_corners(x, shape, elements, out):
    own = _own(shape, "least_corners")
    return lambda x, shape, elements, out: own(x, shape, elements, out)


for _stub in (mean_gradient, volume_ratio):
    _measure(_stub, _stub.__name__)

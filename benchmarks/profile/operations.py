# SPDX-License-Identifier: Apache-2.0
"""Number of floating-point operations of an element: its kernels are run as Python with numbers that count operations.

This runs in a separate process, ``NUMBA_DISABLE_JIT=1 python -m benchmarks.profile.operations``. The compiled kernels
may need fewer operations, but never more.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from types import ModuleType, SimpleNamespace

import numpy as np

from benchmarks.savings import HYPERELASTIC, LINEAR
from gdfe_ros.materials import Material, stress, tensor
from gdfe_ros.mesh import bar
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements import corners, hexahedra, hourglass, stress_rows
from gdfe_ros.solver.elements.blocks import LANES, ROWS

LAWS: dict[str, Material] = {"linear": LINEAR, **HYPERELASTIC}


class Counted(float):
    """A number that counts the operations with it; a division, a root and a logarithm each count as one operation."""

    done = 0


def _counting(name: str) -> None:
    plain = getattr(np.float64, name)

    def operation(self: Counted, *others: float) -> Counted:
        Counted.done += 1
        with np.errstate(all="ignore"):
            return Counted(plain(np.float64(self), *others))

    setattr(Counted, name, operation)


for _name in ("add", "radd", "sub", "rsub", "mul", "rmul", "truediv", "rtruediv", "neg"):
    _counting(f"__{_name}__")


def _function(name: str) -> object:
    def function(value: float) -> Counted:
        Counted.done += 1
        return Counted(getattr(math, name)(value))

    return function


_MATH = SimpleNamespace(**{name: _function(name) for name in ("sqrt", "log", "exp")}, **{"copysign": math.copysign})
_MODULES: tuple[ModuleType, ...] = (stress, tensor, hourglass, stress_rows)


def bar_of(law: str, cells: tuple[int, int, int]) -> Body:
    """Return a bar of one of `LAWS` without constraints."""
    mesh = bar((0.5, 0.05, 0.05), cells)
    return Body.build(mesh.vertices, mesh.cells, [LAWS[law]], np.zeros(mesh.n_cells, np.int32), [])


def count(law: str) -> float:
    """Return the number of operations of one slightly deformed element."""
    body = bar_of(law, (LANES, 1, 1))
    for module in _MODULES:
        module.math = _MATH
    b = np.empty(ROWS * LANES, dtype=object)
    blocks, material = body.blocks, body.material
    elements, none = blocks.element[0], np.zeros(len(material))
    corners.load_geometry(b, blocks.geometry, 0)
    corners.load_corners(b, 1.1 * body.rest + 0.1 * body.rest[:, ::-1], body.shape, elements)
    hexahedra.load_parameters(b, elements, material, none, none + 1.0, body.table)
    for i, value in enumerate(b):
        b[i] = Counted(value or 0.0)
    Counted.done = 0
    corners.gather_parallel(b)
    hexahedra.stress_rows(b, blocks.law[0], elements, material, body.table)
    hexahedra.hourglass_rows(b)
    corners.scatter_parallel(b)
    return Counted.done / LANES


def counts() -> dict[str, float]:
    """Return dict from law to the number of operations of an element, counted in another process."""
    command = [sys.executable, "-m", "benchmarks.profile.operations"]
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    return json.loads(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)


if __name__ == "__main__":
    print(json.dumps({law: count(law) for law in LAWS}))

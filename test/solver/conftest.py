# SPDX-License-Identifier: Apache-2.0
"""Bodies under test: regular, distorted and sheared meshes, each law, handles at chosen faces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gdfe_ros.constraints import Handle
from gdfe_ros.materials import Curve, CurveData, Law, Linear, Material, NeoHookean, StableNeoHookean, preset
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.settings import Torsion
from gdfe_ros.solver.solution import Increment, Solution

LAWS: dict[str, Material] = {
    "linear": Linear(young=1e5, poisson=0.3),
    "linear-0.499": Linear(young=1e5, poisson=0.499),
    "neo-hookean": NeoHookean(young=1e5, poisson=0.45),
    "neo-hookean-0.495": NeoHookean(young=1e5, poisson=0.495),
    "stable-neo-hookean-0.48": StableNeoHookean(young=1e5, poisson=0.48),
    "ogden": preset("ninjaflex", law=Law.OGDEN, poisson=0.4),
    "ogden-0.495": preset("cheetah", law=Law.OGDEN, poisson=0.495),
    "curve-polynomial": preset("cheetah", law=Law.CURVE, poisson=0.45),
    "curve-table": Curve(data=CurveData.table([0.1, 0.4, 1.0, 2.0], [1.6e5, 4e5, 6.4e5, 11.9e5]), poisson=0.495),
}


@pytest.fixture(params=LAWS.values(), ids=LAWS)
def law(request: pytest.FixtureRequest) -> Material:
    """Give each stress-strain law in turn."""
    return request.param


@pytest.fixture(scope="session")
def distorted() -> HexMesh:
    """Return a mesh of 3 x 3 x 3 general hexahedra: each vertex is displaced by up to a fifth of an edge."""
    mesh = bar([0.3, 0.3, 0.3], [3, 3, 3])
    return HexMesh(mesh.vertices + np.random.default_rng(5).uniform(-0.02, 0.02, mesh.vertices.shape), mesh.cells)


@pytest.fixture(scope="session", params=["cube", "box", "sheared", "distorted"])
def element(request: pytest.FixtureRequest) -> HexMesh:
    """Give one element of each shape."""
    cube = bar([0.1, 0.1, 0.1], [1, 1, 1])
    shapes = {
        "cube": cube.vertices,
        "box": cube.vertices * (1.0, 2.0, 0.5),
        "sheared": cube.vertices @ np.array([[1.0, 0.3, 0.1], [0.0, 1.2, 0.4], [0.0, 0.0, 0.7]]),
        "distorted": cube.vertices + np.random.default_rng(4).uniform(-0.015, 0.015, (8, 3)),
    }
    return HexMesh(shapes[request.param], cube.cells)


MakeBody = Callable[..., Body]


@pytest.fixture(scope="session")
def make_body() -> MakeBody:
    """Return a function that makes a body of one material, or of several with an index of the material per cell."""

    def make(
        mesh: HexMesh,
        material: Material | Sequence[Material] | None = None,
        handles: Sequence[Handle] = (),
        cell_material: NDArray[np.int32] | None = None,
        torsion: Torsion = Torsion.CELL,
    ) -> Body:
        if material is None:
            material = LAWS["linear"]
        materials = [material] if isinstance(material, Material) else list(material)
        which = np.zeros(mesh.n_cells, np.int32) if cell_material is None else cell_material
        return Body.build(mesh.vertices, mesh.cells, materials, which, handles, torsion=torsion)

    return make


@pytest.fixture(scope="session")
def end() -> Callable[[HexMesh, str], NDArray[np.int32]]:
    """Return a function from a bar and 'x-' or 'x+' to the indices of the vertices on that face."""

    def vertices(mesh: HexMesh, face: str) -> NDArray[np.int32]:
        x = mesh.vertices[:, 0]
        return np.flatnonzero(x == (x.min() if face == "x-" else x.max())).astype(np.int32)

    return vertices


@pytest.fixture(scope="session")
def boundary() -> Callable[[HexMesh], Handle]:
    """Return a function from a mesh to a handle that holds every vertex of its surface."""

    def handle(mesh: HexMesh) -> Handle:
        return Handle("surface", np.unique(mesh.surface()).astype(np.int32))

    return handle


def solve(equilibrium: Any, start: NDArray[np.float64], base: NDArray[np.float64], **options: Any) -> Solution:
    """Solve from ``start`` [m] with the handles' vertices at ``base`` [m]."""
    state = equilibrium.at_rest().with_(positions=start, base=base)
    return equilibrium.solve(Increment.at(state, **{"tolerance": 1e-6, "limit": 2000, **options}), state)

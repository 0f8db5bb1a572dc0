# SPDX-License-Identifier: Apache-2.0
"""MJCF models of the benchmark bars: interpolated flexes on a lattice of sliding bodies.

Every lattice node except the clamped ones is a body. One flex per segment interpolates the solid
between the nodes; flexes have common nodes at the borders between segments. Such flexes have only
one elastic law: corotated linear elasticity with Young's modulus and Poisson's ratio (the stress of
a cell is exactly linear in uniaxial stretches of 1 to 60 %). At finite strain it differs from the
scenes' neo-Hookean law, in forces more than in shapes.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from itertools import permutations

import numpy as np
import numpy.typing as npt

from benchmarks.cases import Law, LogNeoHooke
from benchmarks.grids import Grid

Array = npt.NDArray[np.float64]

DENSITY = 10.0
"""Density of the bar [kg/m^3]. It is small, so that inertia does not delay the static solution."""
HANDLE_MASS = 1e5
"""Mass of a node of a driven handle [kg]. It is so large that the bar cannot slow the node in a step."""


class Drive(Enum):
    """Method by which the right face follows its prescribed motion."""

    HEAVY = "heavy"
    """Sliding bodies of large mass; their velocity is set such that they reach the target in one step.
    An equality between two of them, which is always satisfied, makes MuJoCo factor the whole system."""
    MOCAP = "mocap"
    """Bodies without degrees of freedom, and conjugate gradients: fast for stocky bars, but slender
    bars do not come to equilibrium."""
    FREE = "free"
    """No prescribed motion. An equality between two nodes, satisfied by symmetry, has the same purpose as above."""


def body_name(node: int) -> str:
    """Return the name of the body at a lattice node."""
    return f"node{node}"


def write_model(
    laws: Sequence[Law], grid: Grid, drive: Drive, *, timestep: float, density: float = DENSITY, gravity: float = 0.0
) -> str:
    """Return the MJCF text of a bar.

    Args:
        laws: laws of equal segments along x; they must be neo-Hookean, and their E and nu are used.
        grid: lattice of order 1 (``dof="trilinear"``) or 2 (``dof="quadratic"``).
        drive: method by which the right face is moved.
        timestep: time step of the integrator [s].
        density: density of the bar [kg/m^3].
        gravity: downward acceleration [m/s^2].

    Raises:
        ValueError: if a law has no Young's modulus.
    """
    flexes = [_flex(laws, grid, index) for index in range(len(laws))]
    face, tie = grid.face(right=True), ""
    if drive is not Drive.MOCAP:
        last, axis = (face[-1], "x") if drive is Drive.HEAVY else (face[grid.steps[1]], "z")
        first, second = (f"{body_name(int(node))}_{axis}" for node in (face[0], last))
        tie = f'<equality><joint joint1="{first}" joint2="{second}" polycoef="0 1 0 0 0"/></equality>'
    option = (
        f'<option timestep="{timestep:g}" integrator="discrete" solver="Newton" iterations="50" tolerance="1e-15" '
        f'gravity="0 0 {-gravity:g}"><flag contact="disable"/></option>'
    )
    bodies, solids = "".join(_bodies(grid, drive, density)), "".join(flexes)
    return f"<mujoco>{option}<worldbody>{bodies}</worldbody><deformable>{solids}</deformable>{tie}</mujoco>"


def node_masses(grid: Grid, density: float = DENSITY) -> Array:
    """Return lumped nodal masses, shape (n,), float64 [kg] (Simpson's rule, order 2)."""
    axes = []
    for steps in grid.steps:
        weight = np.ones(steps + 1)
        if grid.order == 2:
            weight[1::2], weight[2:-1:2] = 4.0, 2.0
        else:
            weight[1:-1] = 2.0
        axes.append(weight / weight.sum())
    x, y, z = axes
    return density * float(np.prod(grid.size)) * np.einsum("k,j,i->kji", z, y, x).ravel()


def _bodies(grid: Grid, drive: Drive, density: float) -> list[str]:
    points, masses = grid.points(), node_masses(grid, density)
    left, right = set(grid.face(right=False).tolist()), set(grid.face(right=True).tolist())
    lines = []
    # MuJoCo factors in the order of the bodies: slices across the bar keep the bandwidth small.
    for node in _segment_nodes(grid, 0, grid.cells[0]):
        x, y, z = points[node]
        head = f'<body name="{body_name(node)}" pos="{x:.9g} {y:.9g} {z:.9g}"'
        if node in left:
            continue
        if node in right and drive is Drive.MOCAP:
            lines.append(f'{head} mocap="true"/>')
            continue
        mass = HANDLE_MASS if node in right and drive is Drive.HEAVY else masses[node]
        joints = "".join(
            f'<joint name="{body_name(node)}_{axis}" type="slide" axis="{direction}"/>'
            for axis, direction in (("x", "1 0 0"), ("y", "0 1 0"), ("z", "0 0 1"))
        )
        inertia = f'<inertial pos="0 0 0" mass="{mass:.9g}" diaginertia="1e-9 1e-9 1e-9"/>'
        lines.append(f"{head}>{inertia}{joints}</body>")
    return lines


def _flex(laws: Sequence[Law], grid: Grid, index: int) -> str:
    """Return the MJCF text of the flex of one segment; its embedded mesh has one vertex per cell corner."""
    law = laws[index]
    if not isinstance(law, LogNeoHooke):
        raise ValueError(f"MuJoCo has no law for {type(law).__name__}")
    count, (nx, ny, nz) = len(laws), grid.cells
    along = nx // count
    nodes = _segment_nodes(grid, index * along, (index + 1) * along)
    left = set(grid.face(right=False).tolist())
    points = grid.points()
    names = " ".join("world" if node in left else body_name(node) for node in nodes)
    coordinates = " ".join(_vector(points[node]) if node in left else "0 0 0" for node in nodes)
    length = grid.size[0] / count
    part = Grid(size=(length, *grid.size[1:]), cells=(along, ny, nz))
    corners = part.points() + np.array([index * length, 0.0, 0.0])
    return (
        f'<flex name="segment{index}" dim="3" radius="0.001" dof="{"quadratic" if grid.order == 2 else "trilinear"}" '
        f'cellcount="{along} {ny} {nz}" body="{" ".join(["world"] * len(corners))}" '
        f'vertex="{" ".join(map(_vector, corners))}" element="{" ".join(map(str, tetrahedra(part).ravel()))}" '
        f'node="{names}" nodecoord="{coordinates}"><contact contype="0" conaffinity="0" selfcollide="none"/>'
        f'<elasticity young="{law.young:g}" poisson="{law.poisson:g}" damping="0"/></flex>'
    )


def _vector(point: Array) -> str:
    return f"{point[0]:.9g} {point[1]:.9g} {point[2]:.9g}"


def _segment_nodes(grid: Grid, first: int, last: int) -> list[int]:
    """Return the lattice nodes of the cells first..last along x in MuJoCo's order: the z index changes fastest."""
    nx, ny, nz = grid.steps
    lattice = np.arange((nx + 1) * (ny + 1) * (nz + 1)).reshape(nz + 1, ny + 1, nx + 1)
    part = lattice[:, :, first * grid.order : last * grid.order + 1]
    return [int(node) for node in part.transpose(2, 1, 0).ravel()]


def tetrahedra(grid: Grid) -> npt.NDArray[np.int32]:
    """Return six positively oriented tetrahedra for each cell (Kuhn), shape (6 m, 4), int32."""
    corners = []
    for order in permutations(range(3)):
        vertex, path = np.full(3, -1.0), [np.full(3, -1.0)]
        for axis in order:
            vertex = vertex.copy()
            vertex[axis] = 1.0
            path.append(vertex)
        edges = np.array(path[1:]) - path[0]
        corners.append(path if np.linalg.det(edges) > 0 else [path[0], path[2], path[1], path[3]])
    return np.concatenate([grid.connectivity(np.array(path)) for path in corners])

# SPDX-License-Identifier: Apache-2.0
"""MuJoCo 4 flex on the scene `drop`: its ``discrete`` integrator (implicit, first order) with a constant time step.

As in `mujoco_model`, every lattice node is a body. A dummy equality, which is always satisfied by symmetry, makes
MuJoCo factor the whole system. The material law is corotated linear elasticity without damping.
"""

from __future__ import annotations

from time import process_time

import numpy as np

from benchmarks.grids import Grid
from benchmarks.peers import mujoco_model
from benchmarks.peers.drop_case import DENSITY, GRAVITY, LASTS, LAW, SIZE, TIP, DropPath
from benchmarks.peers.mujoco_model import body_name, tetrahedra
from benchmarks.peers.mujoco_peer import available
from benchmarks.peers.peer import PeerError

__all__ = ["available", "simulate"]

_BAD = ("mjWARN_BADQPOS", "mjWARN_BADQVEL", "mjWARN_BADQACC")


def simulate(order: int, cells: tuple[int, int, int], h: float, *, timeout: float) -> DropPath:
    """Return the path of the tip for the time step ``h`` [s], with trilinear (order 1) or quadratic (order 2) flexes.

    Raises:
        PeerError: the state becomes unusable, or the steps take more than ``timeout`` [s] of processor time.
    """
    import mujoco

    # It would print and log, in every run, that the solve before that of the whole system did not converge.
    mujoco.set_mju_user_warning(lambda _: None)
    grid = Grid(size=SIZE, cells=cells, order=order)
    where = f"mujoco drop order {order} {grid.label}, h = {h:g} s"
    model = mujoco.MjModel.from_xml_string(_model(grid, h))
    data = mujoco.MjData(model)
    free = np.setdiff1d(np.arange(len(grid.points())), grid.face(right=False))
    dofs = model.body_dofadr[[model.body(body_name(int(node))).id for node in free]][:, None] + np.arange(3)
    started, found = process_time(), []
    for _ in range(round(LASTS / h)):
        mujoco.mj_step(model, data)
        found.append(data.qpos[dofs])
        if process_time() - started > timeout:
            raise PeerError(f"{where}: not done within {timeout:g} s")
    seconds = process_time() - started
    bad = [name for name in _BAD if data.warning[int(mujoco.mjtWarning.__members__[name])].number]
    if bad or not np.isfinite(found[-1]).all():
        raise PeerError(f"{where}: the state became unusable ({', '.join(bad) or 'not finite'})")
    moved, path = np.zeros((len(grid.points()), 3)), []
    for displacement in found:
        moved[free] = displacement
        path.append(np.add(TIP, grid.evaluate(moved, np.array([TIP]))[0]))
    return DropPath(h * np.arange(1, len(path) + 1), np.array(path), seconds)


def _model(grid: Grid, h: float) -> str:
    """Return the MJCF text of the model."""
    points, left = grid.points(), set(grid.face(right=False).tolist())
    nx, ny, nz = grid.steps
    lattice = np.arange(len(points)).reshape(nz + 1, ny + 1, nx + 1)
    nodes = lattice.transpose(2, 1, 0).ravel().tolist()
    masses = mujoco_model.node_masses(grid) * DENSITY / mujoco_model.DENSITY
    bodies = "".join(_body(node, points[node], masses[node]) for node in nodes if node not in left)
    tie = "".join(f' joint{place + 1}="{body_name(int(node))}_z"' for place, node in enumerate(lattice[0, [0, ny], nx]))
    corners = Grid(size=SIZE, cells=grid.cells)
    flex = (
        f'<flex name="bar" dim="3" radius="0.001" dof="{"quadratic" if grid.order == 2 else "trilinear"}" '
        f'cellcount="{_text(grid.cells)}" body="{" ".join(["world"] * len(corners.points()))}" '
        f'vertex="{_text(corners.points().ravel())}" element="{_text(tetrahedra(corners).ravel())}" '
        f'node="{" ".join("world" if node in left else body_name(node) for node in nodes)}" '
        f'nodecoord="{_text(np.concatenate([points[n] if n in left else np.zeros(3) for n in nodes]))}">'
        '<contact contype="0" conaffinity="0" selfcollide="none"/>'
        f'<elasticity young="{LAW.young:g}" poisson="{LAW.poisson:g}" damping="0"/></flex>'
    )
    option = (
        f'<option timestep="{h:g}" integrator="discrete" solver="Newton" iterations="50" tolerance="1e-15" '
        f'gravity="0 0 {-GRAVITY}"><flag contact="disable"/></option>'
    )
    equality = f'<equality><joint{tie} polycoef="0 1 0 0 0"/></equality>'
    solid = f"<worldbody>{bodies}</worldbody><deformable>{flex}</deformable>"
    return f"<mujoco>{option}{solid}{equality}</mujoco>"


def _body(node: int, place: np.ndarray, mass: float) -> str:
    joints = "".join(
        f'<joint name="{body_name(node)}_{axis}" type="slide" axis="{direction}"/>'
        for axis, direction in (("x", "1 0 0"), ("y", "0 1 0"), ("z", "0 0 1"))
    )
    inertia = f'<inertial pos="0 0 0" mass="{mass:.9g}" diaginertia="1e-9 1e-9 1e-9"/>'
    return f'<body name="{body_name(node)}" pos="{_text(place)}">{inertia}{joints}</body>'


def _text(numbers: object) -> str:
    return " ".join(f"{number:.9g}" for number in numbers)

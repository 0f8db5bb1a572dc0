# SPDX-License-Identifier: Apache-2.0
"""MuJoCo 4 flex on the scene `drop`: its ``discrete`` integrator (implicit, first order) with a constant time step.

The model is that of `mujoco_model`; the material law is corotated linear elasticity without damping.
"""

from __future__ import annotations

from time import process_time

import numpy as np

from benchmarks.grids import Grid
from benchmarks.peers.drop_case import DENSITY, GRAVITY, LASTS, LAW, SIZE, TIP, DropPath
from benchmarks.peers.mujoco_model import Drive, body_name, write_model
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
    text = write_model([LAW], grid, Drive.FREE, timestep=h, density=DENSITY, gravity=GRAVITY)
    model = mujoco.MjModel.from_xml_string(text)
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

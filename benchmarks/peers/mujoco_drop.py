# SPDX-License-Identifier: Apache-2.0
"""MuJoCo 4 flex on the scene `drop`: its ``discrete`` integrator (implicit, first order) with a constant time step.

The model is that of `mujoco_model`; the material law is corotated linear elasticity without damping.
"""

from __future__ import annotations

from time import process_time

import numpy as np

from benchmarks.grids import Grid
from benchmarks.peers.drop_case import DENSITY, GRAVITY, LASTS, LAW, SIZE, TIP, DropPath
from benchmarks.peers.mujoco_model import Drive, write_model
from benchmarks.peers.mujoco_peer import available, load_lattice, require_usable
from benchmarks.peers.peer import PeerError

__all__ = ["available", "simulate"]


def simulate(kind: str, cells: tuple[int, int, int], h: float, *, timeout: float) -> DropPath:
    """Return the path of the tip for the time step ``h`` [s], with a ``trilinear flex`` or a ``quadratic flex``.

    Raises:
        PeerError: the state becomes unusable, or the steps take more than ``timeout`` [s] of processor time.
    """
    import mujoco

    grid = Grid(size=SIZE, cells=cells, order=2 if kind.startswith("quadratic") else 1)
    where = f"mujoco drop {kind} {grid.label}, h = {h:g} s"
    text = write_model([LAW], grid, Drive.FREE, timestep=h, density=DENSITY, gravity=GRAVITY)
    model, data, free, dofs = load_lattice(text, grid, grid.face(right=False))
    started, found = process_time(), []
    for _ in range(round(LASTS / h)):
        mujoco.mj_step(model, data)
        found.append(data.qpos[dofs])
        if process_time() - started > timeout:
            raise PeerError(f"{where}: not done within {timeout:g} s")
    seconds = process_time() - started
    require_usable(data, where)
    moved, path = np.zeros((len(grid.points()), 3)), []
    for displacement in found:
        moved[free] = displacement
        path.append(np.add(TIP, grid.evaluate(moved, np.array([TIP]))[0]))
    return DropPath(h * np.arange(1, len(path) + 1), np.array(path), seconds)

# SPDX-License-Identifier: Apache-2.0
"""The STIFF-FLOP module: a silicone tube with six braided chambers, its section, mesh and scene (dimensions in metres).

Dimensions are the constants of the authors' examples (Sadati et al. 2020). The two chambers of a pair share one
pressure. The thread around a chamber is a layer of hoops on its wall.
"""

from __future__ import annotations

import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import meshio
import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes import read_scene
from gdfe_ros.scene import Scene, scene_from_text

Array = NDArray[np.float64]
LENGTH, OUTER, BORE, CHAMBER, CIRCLE = 44e-3, 12.5e-3, 4.5e-3, 2.5e-3, 8.5e-3
"""Length, outer radius, radius of the bore and of the chambers, and radius of the circle of the chambers' axes."""
BESIDE, PAIRS = 20.3, {"p0": 90.0, "p1": -30.0, "p2": 210.0}
"""Angle from a pair's direction to its chambers [degrees], and direction of each pair."""
THREAD = 2.0e4
"""Stiffness of the hoops [N/m]: that of a thread of 0.2 mm is far larger, but hoops of this one do not stretch."""
SIZE, LAYERS = 2e-3, 12
"""Largest edge in the section [m], and layers along the module."""


def chamber_axes() -> dict[str, Array]:
    """Return dict from pair to the axes (2, 2) [m] of its chambers."""
    turns = {name: np.radians([angle - BESIDE, angle + BESIDE]) for name, angle in PAIRS.items()}
    return {name: CIRCLE * np.column_stack([np.cos(turn), np.sin(turn)]) for name, turn in turns.items()}


def module_scene(folder: Path, young: float) -> Scene:
    """Return the scene of the module: actuators ``p0a``, ``p0b`` .. ``p2b``, handles ``base`` and ``tip``.

    Args:
        folder: folder into which the mesh is written.
        young: Young's modulus of the silicone, a neo-Hookean body [Pa].

    Raises:
        RuntimeError: gmsh is not installed.
    """
    points, quads = _section()
    levels = np.linspace(0.0, LENGTH, LAYERS + 1)
    vertices = np.vstack([np.column_stack([points, np.full(len(points), z)]) for z in levels])
    cells = np.vstack([np.hstack([quads + k * len(points), quads + (k + 1) * len(points)]) for k in range(LAYERS)])
    meshio.write(folder / "module.vtu", meshio.Mesh(vertices, [("hexahedron", cells)]))
    walls = {}
    for name, axes in chamber_axes().items():
        for letter, axis in zip("ab", axes, strict=True):
            near = np.linalg.norm(vertices[:, :2] - axis, axis=1) < 1.01 * CHAMBER
            walls[f"{name}{letter}"] = {"vertices": np.flatnonzero(near).tolist()}
    ends = {"base": vertices[:, 2] < 1e-9, "tip": vertices[:, 2] > LENGTH - 1e-9}
    held = {name: {"vertices": np.flatnonzero(ids).tolist()} for name, ids in ends.items()}
    thread = {"along": [0, 0, 1], "angles_deg": [90], "stiffness": THREAD, "compression": True}
    given = {
        "mesh.file": str(folder / "module.vtu"),
        "materials.silicone.young": float(young),
        "handles.base.where": held["base"],
        "handles.tip.where": held["tip"],
        "loads.sensor.surface.where": held["tip"],
        "actuators": {name: {"chamber": {"where": where}} for name, where in walls.items()},
        "fibres": {f"thread_{name}": {"where": where, **thread} for name, where in walls.items()},
    }
    return scene_from_text(read_scene("module.yaml"), origin="of the module", overrides=given)


def _section() -> tuple[Array, NDArray[np.int64]]:
    """Return the points (n, 2) [m] and quadrilaterals (m, 4) of the section, counter-clockwise."""
    axes = np.vstack(list(chamber_axes().values()))
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        points, quads = pool.submit(_mesh_section, 1e3 * axes, 1e3 * SIZE).result()
    used, quads = np.unique(quads, return_inverse=True)
    points, quads = 1e-3 * points[used], quads.reshape(-1, 4)
    corners = points[quads]
    across = corners[:, 2:] - corners[:, :2]
    clockwise = across[:, 0, 0] * across[:, 1, 1] < across[:, 0, 1] * across[:, 1, 0]
    quads[clockwise] = quads[clockwise, ::-1]
    return points, quads


def _mesh_section(axes: Array, size: float) -> tuple[Array, NDArray[np.int64]]:
    """Mesh the section [mm] with gmsh, in a process of its own, because gmsh's licence (GPL) requires it."""
    try:
        import gmsh
    except ImportError as error:
        raise RuntimeError("gmsh is not installed; remedy: pip install 'gdfe_ros[cad]'") from error
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    gmsh.initialize()
    occ, option = gmsh.model.occ, gmsh.option.setNumber
    tube = (2, occ.addDisk(0, 0, 0, 1e3 * OUTER, 1e3 * OUTER))
    holes = [(2, occ.addDisk(0, 0, 0, 1e3 * BORE, 1e3 * BORE))]
    holes += [(2, occ.addDisk(x, y, 0, 1e3 * CHAMBER, 1e3 * CHAMBER)) for x, y in axes]
    occ.cut([tube], holes)
    occ.synchronize()
    option("Mesh.MeshSizeMax", 2.0 * size)
    option("Mesh.Algorithm", 5)
    option("Mesh.RecombineAll", 1)
    option("Mesh.RecombinationAlgorithm", 1)
    option("Mesh.SubdivisionAlgorithm", 1)
    option("Mesh.RandomSeed", 1)
    option("Mesh.Smoothing", 20)
    gmsh.model.mesh.generate(2)
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    _, quads = gmsh.model.mesh.getElementsByType(3)
    place = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    place[tags.astype(np.int64)] = np.arange(len(tags))
    points = coordinates.reshape(-1, 3)[:, :2].copy()
    quads = place[quads.astype(np.int64)].reshape(-1, 4)
    gmsh.finalize()
    return points, quads

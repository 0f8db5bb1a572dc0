# SPDX-License-Identifier: Apache-2.0
"""Slender and thin bodies that were not used to develop the solver: ring, helix, shell, truss, hairs, hinged chain."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes import read_scene
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.mesh.assembly import keep_cells
from gdfe_ros.mesh.files.stored_mesh import pack_mesh
from gdfe_ros.scene import Scene, scene_from_text

CLAMP = "clamp"
"""Name of the fixed vertex set."""
TEXT = read_scene("slender.yaml.in")
Warp = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def _scene(mesh: HexMesh, held: NDArray[np.bool_], gravity: float, hard: str = "") -> Scene:
    kept = HexMesh(mesh.vertices, mesh.cells, {}, {CLAMP: np.flatnonzero(held)})
    return scene_from_text(TEXT.format(mesh=pack_mesh(kept), clamp=CLAMP, gravity=gravity, hard=hard))


def _bent(size: tuple[float, float, float], cells: tuple[int, int, int], warp: Warp, gravity: float) -> Scene:
    """Return a scene with a bar or plate along x that is warped to another undeformed shape and fixed at x = 0."""
    straight = bar(size, cells)
    return _scene(HexMesh(warp(straight.vertices), straight.cells, {}, {}), straight.vertices[:, 0] == 0.0, gravity)


def ring() -> Scene:
    """Return a ring 50 times as long as thick, slit at the bottom and fixed at one lip; its weight opens it."""

    def warp(points: NDArray[np.float64]) -> NDArray[np.float64]:
        angle, radius = (points[:, 0] / 0.3 * 1.96 - 0.48) * np.pi, 0.05 - points[:, 2]
        return np.stack([radius * np.cos(angle), points[:, 1], radius * np.sin(angle)], axis=1)

    return _bent((0.3, 0.006, 0.006), (120, 2, 2), warp, -1.5)


def helix() -> Scene:
    """Return a helical spring with three turns that hangs from its upper end."""

    def warp(points: NDArray[np.float64]) -> NDArray[np.float64]:
        angle, radius = 6.0 * np.pi * points[:, 0] / 0.6, 0.03 - points[:, 1]
        return np.stack([radius * np.cos(angle), radius * np.sin(angle), points[:, 2] - 0.1 * points[:, 0]], axis=1)

    return _bent((0.6, 0.005, 0.005), (180, 2, 2), warp, -0.5)


def shell() -> Scene:
    """Return half a cylinder with a thickness of 1/50 of its radius, fixed along one edge, under its weight."""

    def warp(points: NDArray[np.float64]) -> NDArray[np.float64]:
        angle, radius = np.pi * points[:, 0] / 0.15, 0.05 + points[:, 2]
        return np.stack([-radius * np.cos(angle), points[:, 1], radius * np.sin(angle)], axis=1)

    return _bent((0.15, 0.1, 0.001), (30, 20, 1), warp, -0.3)


def truss() -> Scene:
    """Return a lattice with four by two fields, fixed at one end; the bars are ten times as long as thick."""
    whole = bar((0.205, 0.005, 0.105), (41, 1, 21))
    column, row = np.floor(whole.vertices[whole.cells].mean(axis=1)[:, [0, 2]] / 0.005).astype(int).T
    mesh = keep_cells(whole, (column % 10 == 0) | (row % 10 == 0))
    return _scene(mesh, mesh.vertices[:, 0] == 0.0, -4.0)


def hairs() -> Scene:
    """Return a block that is fixed at its bottom, with two hairs at its side that are 50 times as long as thick."""
    whole = bar((0.24, 0.04, 0.04), (60, 10, 10))
    x, y, z = np.floor(whole.vertices[whole.cells].mean(axis=1) / 0.004).astype(int).T
    mesh = keep_cells(whole, (x < 10) | ((z == 0) & ((y == -3) | (y == 2))))
    block = mesh.vertices[:, 0] < 0.0401
    return _scene(mesh, block & (mesh.vertices[:, 2] == mesh.vertices[:, 2].min()), -0.3)


def chain() -> Scene:
    """Return a chain of hard links; soft hinges of a quarter of the links' height connect them."""
    whole = bar((0.2, 0.02, 0.02), (50, 4, 4))
    column, _, row = np.floor(whole.vertices[whole.cells].mean(axis=1) / [0.004, 0.005, 0.005]).astype(int).T
    mesh = keep_cells(whole, (column % 10 < 8) | (row == 1))
    links = "".join(f", {{material: hard, where: {{box: {{x: [{x:g}, {x + 0.032:g}]}}}}}}" for x in np.arange(5) * 0.04)
    return _scene(mesh, mesh.vertices[:, 0] == 0.0, -1.0, links)


FORK = read_scene("fork.yaml.in")
FINGERS = {"left": -0.016, "middle": 0.0, "right": 0.016}
"""Dict from finger of a fork to its lateral position [m]."""


def fork(shortened: Mapping[str, float]) -> Scene:
    """Return a body with three fingers, 40 times as long as thick; their cables are ``shortened`` [m]."""
    whole = bar((0.2, 0.036, 0.006), (50, 18, 2))
    x, y, _ = np.floor(whole.vertices[whole.cells].mean(axis=1) / [0.004, 0.002, 0.003]).astype(int).T
    mesh = keep_cells(whole, (x < 6) | (y < -7) | (y >= 7) | (y == -1) | (y == 0))
    kept = HexMesh(mesh.vertices, mesh.cells, {}, {CLAMP: np.flatnonzero(mesh.vertices[:, 0] == 0.0)})
    points = (0.004, 0.04, 0.08, 0.12, 0.16, 0.198)
    cables = "\n".join(
        f"  {name}: {{cable: {{points: {[[x, y, 0.002] for x in points]}, command: shortening}}}}"
        for name, y in FINGERS.items()
    )
    pulls = ", ".join(f"{name}: [{{time: 1.0, value: {value}}}]" for name, value in shortened.items())
    return scene_from_text(FORK.format(mesh=pack_mesh(kept), clamp=CLAMP, cables=cables, pulls=pulls))


SLENDER_BODIES: Mapping[str, Callable[[], Scene]] = {
    "ring": ring,
    "helix": helix,
    "shell": shell,
    "truss": truss,
    "block with hairs": hairs,
    "hinged chain": chain,
}

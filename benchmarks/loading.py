# SPDX-License-Identifier: Apache-2.0
"""Time to load a body with a skin, the first time and from the cache: ``python -m benchmarks.loading``."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import trimesh

from gdfe_ros.mesh.generators import finger

SCENE = """
name: cad_finger
mesh: {{voxels: {{surface: {name}.stl, cell: {cell}, cells: cut}}}}
skin: {{file: {name}.stl}}
materials: {{silicone: {{law: neo_hookean, young: 1.2e5, poisson: 0.45}}}}
regions: [{{material: silicone}}]
handles: {{base: {{where: {{face: x-}}, fixed: true}}}}
"""
CELLS = {"notched": 0.0029, "bellows": 0.0033}
"""Dict from finger to the edge length of its cells [m]."""
_TIMED = """
import sys, time
from gdfe_ros import load_scene
import gdfe_ros.simulation
start = time.process_time()
scene = load_scene(sys.argv[1])
print(scene.mesh.n_cells, time.process_time() - start)
"""


def notched() -> trimesh.Trimesh:
    """Return the surface of a finger with five notches; it has few large triangles."""
    mesh = finger((0.12, 0.02, 0.018), joints=5, gap=0.004, web=0.005, cell=0.02, taper=0.8)
    return trimesh.Trimesh(mesh.vertices, mesh.surface()[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3))


def bellows() -> trimesh.Trimesh:
    """Return the surface of a wavy finger with a round tip; it has many small triangles."""
    z = np.linspace(0.0, 0.1, 121)
    radius = 0.011 + 0.0012 * np.cos(2.0 * np.pi * z / 0.0125)
    radius *= np.sqrt(np.maximum(1.0 - np.square(np.maximum(z - 0.09, 0.0) / 0.01), 0.0))
    surface = trimesh.creation.revolve(np.vstack([[0.0, 0.0], np.column_stack([radius, z])]), sections=96)
    surface.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2.0, [0.0, 1.0, 0.0]))
    return surface


def measure(name: str, surface: trimesh.Trimesh, folder: Path) -> tuple[int, float, float]:
    """Return the number of cells, and the processor times [s] of loading the scene the first and the second time."""
    surface.export(folder / f"{name}.stl")
    scene = folder / f"{name}.yaml"
    scene.write_text(SCENE.format(name=name, cell=CELLS[name]))
    alone = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "NUMBA_CACHE_DIR": str(folder)}
    found = []
    for _ in range(3):  # the first process compiles
        command = [sys.executable, "-c", _TIMED, str(scene)]
        done = subprocess.run(command, env=alone, capture_output=True, text=True, check=True)
        found.append(done.stdout.split())
        if len(found) == 1:
            next((folder / "gdfe_ros_bodies").glob("*.npz")).unlink()
    return int(found[0][0]), float(found[1][1]), float(found[2][1])


def main() -> None:
    """Print the table of docs/scene.md."""
    for name, make in (("notched", notched), ("bellows", bellows)):
        with TemporaryDirectory() as folder:
            cells, made, recalled = measure(name, make(), Path(folder))
        print(f"{name}: {cells} cells, made in {made:.2f} s, recalled in {recalled:.2f} s")


if __name__ == "__main__":
    main()

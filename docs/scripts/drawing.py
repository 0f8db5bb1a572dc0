# SPDX-License-Identifier: Apache-2.0
"""From parametric drawings, made by gmsh's CAD kernel, to STEP files, meshes and pictures."""

from __future__ import annotations

import os
import tempfile
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Protocol

import meshio
import numpy as np
from PIL import Image

from gdfe_ros.cli import main as gdfe
from gdfe_ros.mesh.meshing.tetrahedralise import from_step

ROOT = Path(__file__).resolve().parents[2]
IMAGES, SCENES = ROOT / "docs" / "images", ROOT / "config" / "scenes"
WIDTH, COLOURS = 900, 256
"""Width of a picture [px], and number of its colours; with these, a picture has less than 200 kB."""


class Drawing(Protocol):
    """A dataclass with dimensions [mm] that can draw itself."""

    @property
    def volume(self) -> float:
        """Volume [mm^3] of all solids."""

    def draw(self, occ: Any) -> None:
        """Add the solids to ``gmsh.model.occ``, in millimetres: gmsh writes this unit into STEP files."""


def write_step(drawing: Drawing, path: Path) -> None:
    """Write a drawing as STEP, in a separate process, because gmsh's licence (GPL) requires it.

    Raises:
        RuntimeError: gmsh is not installed.
    """
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        pool.submit(_write, drawing, path).result()


def _write(drawing: Drawing, path: Path) -> None:
    try:
        import gmsh
    except ImportError as error:
        raise RuntimeError("gmsh is not installed; remedy: pip install 'gdfe_ros[cad]'") from error
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # gmsh prints the statistics of the STEP file in any case
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    drawing.draw(gmsh.model.occ)
    gmsh.model.occ.synchronize()
    gmsh.write(str(path))
    gmsh.finalize()


def write_mesh(drawing: Drawing, path: Path, *, size: float) -> None:
    """Fill a drawing with quadratic tetrahedra whose edges are at most ``size`` [m] long, and write them as .vtu."""
    with tempfile.TemporaryDirectory() as folder:
        step = Path(folder) / "drawing.step"
        write_step(drawing, step)
        mesh = from_step(step, size=size)
    solid = np.zeros(mesh.n_cells, dtype=np.int32)
    for number, ids in enumerate(mesh.cell_sets.values(), start=1):
        solid[ids] = number
    meshio.Mesh(mesh.vertices, [("tetra10", mesh.cells)], cell_data={"solid": [solid]}).write(path)


def draw_scene(name: str, path: Path) -> None:
    """Play a scene's program and draw its last step as a small PNG file.

    Raises:
        SystemExit: a step does not converge.
    """
    if status := gdfe(["solve", name, "--picture", str(path)]):
        raise SystemExit(status)
    picture = Image.open(path).convert("RGB")
    size = WIDTH, round(WIDTH * picture.height / picture.width)
    picture.resize(size, Image.Resampling.LANCZOS).quantize(COLOURS).save(path, optimize=True)

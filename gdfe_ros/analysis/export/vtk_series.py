# SPDX-License-Identifier: Apache-2.0
"""A run as a series of VTK files, with a ParaView collection that lists their times."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree

import meshio
import numpy as np

from gdfe_ros.analysis.bag_steps import BagStep
from gdfe_ros.mesh import Mesh


def write_vtk_series(steps: Iterable[BagStep], mesh: Mesh, directory: Path) -> int:
    """Write ``step_<number>.vtu`` for each step with a mesh, and ``run.pvd``; return the number of files.

    Points are the current vertices [m] with ``displacement`` [m]; cells have the fields of the strain topic.

    Raises:
        OSError: a file cannot be written.
    """
    directory.mkdir(parents=True, exist_ok=True)
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    collection = ElementTree.SubElement(root, "Collection")
    for step in steps:
        if "mesh" not in step.samples:
            continue
        name = f"step_{step.record.step:06d}.vtu"
        _grid(step, mesh).write(directory / name, file_format="vtu")
        ElementTree.SubElement(collection, "DataSet", timestep=repr(step.record.time), part="0", file=name)
    ElementTree.ElementTree(root).write(directory / "run.pvd", encoding="utf-8", xml_declaration=True)
    return len(collection)


def _grid(step: BagStep, mesh: Mesh) -> meshio.Mesh:
    values = step.samples["mesh"]
    positions, shift = (np.stack([values[start + axis] for axis in "xyz"], axis=1) for start in ("", "u"))
    strain = step.samples.get("strain", {})
    return meshio.Mesh(
        positions,
        [(mesh.vtk, mesh.cells)],
        point_data={"displacement": shift},
        cell_data={name: [field] for name, field in strain.items() if name not in ("x", "y", "z")},
    )

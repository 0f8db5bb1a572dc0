# SPDX-License-Identifier: Apache-2.0
"""The meshes of a robot's links: search of their files, reading, and division into convex pieces."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import unquote, urlparse

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from gdfe_ros.errors import ArmError, MeshError
from gdfe_ros.mesh.shells import shell_numbers
from gdfe_ros.mesh.voxels import examine_surface

Surface = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Vertices (n, 3) [m], and triangles (t, 3)."""
MARK = "package.xml"
"""File that marks a folder as a ROS package."""


def find_mesh(uri: str, *, folder: Path, packages: Mapping[str, Path]) -> Path:
    """Return the path of a mesh file.

    Args:
        uri: ``package://name/path``, ``file:///path``, or a path relative to the folder of the URDF.
        folder: folder of the URDF.
        packages: dict from package to its folder. Other packages are searched in ``AMENT_PREFIX_PATH``, and in and
            beside the folders above the URDF.

    Raises:
        ArmError: there is no such file; the error lists the searched places.
    """
    parts = urlparse(uri)
    if parts.scheme == "package":
        candidates = [base / unquote(parts.path).lstrip("/") for base in _package(parts.netloc, folder, packages)]
        remedy = f"remedy: `packages: {{{parts.netloc}: <folder of that package>}}` in the scene"
    elif parts.scheme in ("", "file"):
        candidates, remedy = [folder / unquote(parts.path)], "remedy: copy the mesh there, or correct its filename"
    else:
        raise ArmError(uri, [f"its scheme is {parts.scheme!r}; allowed: package://, file://, or a path"])
    for path in candidates:
        if path.is_file():
            return path
    places = ", ".join(map(str, candidates)) or f"no folder is known for the package {parts.netloc!r}"
    raise ArmError(uri, [f"the mesh is missing ({places}); {remedy}"])


def _package(name: str, folder: Path, packages: Mapping[str, Path]) -> list[Path]:
    """Return the possible folders of a package: the given folder, else folders in ROS' index and above the URDF."""
    if name in packages:
        return [packages[name]]
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    found = [Path(prefix) / "share" / name for prefix in prefixes if prefix]
    for above in (folder, *folder.parents):
        found += [above] if above.name == name and (above / MARK).is_file() else []
        found += [above / name] if (above / name / MARK).is_file() else []
    return [path for path in found if path.is_dir()]


def read_surface(uri: str, path: Path) -> Surface:
    """Return the vertices (n, 3) of a mesh file, in the file's unit, and its triangles (t, 3).

    Raises:
        ArmError: the file cannot be read.
    """
    try:
        vertices, triangles, _ = examine_surface(path, scale=1.0, closed=False)
    except MeshError as error:
        raise ArmError(uri, error.defects) from error
    return vertices, triangles.astype(np.int64)


def convex_pieces(surface: Surface) -> list[Surface]:
    """Return the convex hull of each connected piece of a surface; normals of its triangles point outward.

    Raises:
        MeshError: a piece is flat.
    """
    vertices, triangles = surface
    pieces, numbers = [], shell_numbers(len(vertices), triangles)
    for number in range(int(numbers.max()) + 1):
        points = vertices[np.unique(triangles[numbers == number])]
        try:
            hull = ConvexHull(points)
        except QhullError as error:
            text = "a piece of it is flat, and bounds no solid; remedy: close it, or leave it out of <collision>"
            raise MeshError("the collision mesh", [text]) from error
        pieces.append(_outward(hull))
    return pieces


def _outward(hull: ConvexHull) -> Surface:
    used, flat = np.unique(hull.simplices, return_inverse=True)
    points, triangles = hull.points[used], flat.reshape(-1, 3).astype(np.int64)
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    triangles[inward] = triangles[inward][:, ::-1]
    return np.ascontiguousarray(points), triangles

# SPDX-License-Identifier: Apache-2.0
"""Meshes of a robot's links: their files are found and read, and their surfaces divided into convex pieces."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import unquote, urlparse

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from gdfe_ros.errors import ArmError, MeshError
from gdfe_ros.mesh.meshing.voxels import SUFFIXES, examine_surface
from gdfe_ros.mesh.surfaces.shells import cone_volumes, shell_numbers
from gdfe_ros.untrusted.regular_file import defect_of, is_file

DEBRIS = 1e-6
"""A convex piece of a collision mesh is ignored if its volume, divided by that of the largest piece, is below this."""
_LONGEST = 200
"""Largest number of characters of a URI or path in an error."""
Surface = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Vertices (n, 3) [m], and triangles (t, 3)."""
LINK_SUFFIXES = (*SUFFIXES, ".dae", ".glb", ".gltf")
"""Suffixes of files with the shape of a link."""


def find_mesh(uri: str, *, folder: Path, packages: Mapping[str, Path]) -> Path:
    """Return the path of a mesh file.

    Args:
        uri: ``package://name/path``, ``file:///path``, or a path relative to the folder of the URDF.
        folder: folder of the URDF.
        packages: dict from package to its folder. Other packages are searched among the folders above the URDF, among
            subfolders of these, and in ``AMENT_PREFIX_PATH``.

    Raises:
        ArmError: there is no such file; the error lists the searched places.
    """
    try:
        parts = urlparse(uri)
    except ValueError as error:  # e.g. a bracket that is not closed
        raise ArmError(uri[:_LONGEST], [f"this is no URI: {error}; allowed: package://, file://, or a path"]) from error
    if parts.scheme == "package":
        candidates = [base / unquote(parts.path).lstrip("/") for base in _package(parts.netloc, folder, packages)]
        remedy = f"remedy: `packages: {{{parts.netloc[:_LONGEST]}: <folder of that package>}}` in the scene"
    elif parts.scheme in ("", "file"):
        candidates, remedy = [folder / unquote(parts.path)], "remedy: copy the mesh there, or correct its filename"
    else:
        raise ArmError(uri, [f"its scheme is {parts.scheme!r}; allowed: package://, file://, or a path"])
    for path in candidates:
        if is_file(path):
            return path
    places = ", ".join(str(path)[:_LONGEST] for path in candidates[:3]) + (", ..." if len(candidates) > 3 else "")
    raise ArmError(uri[:_LONGEST], [f"the mesh is missing ({places}); {remedy}"])


def _package(name: str, folder: Path, packages: Mapping[str, Path]) -> list[Path]:
    """Return the possible folders of a package: the given folder, or else folders in ROS' index and around the URDF.

    Copies of a package often have another folder name, or no ``package.xml``. Therefore each folder above the URDF is
    also tried as the package's folder, the nearest first.
    """
    if name in packages:
        return [packages[name]]
    above = (folder, *folder.parents)
    prefixes = [prefix for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    below = [path / name for path in above]
    named = [path for path in above if path.name == name]
    named += [path for path in below if not defect_of(path) and path.is_dir()]
    return [*named, *(Path(prefix) / "share" / name for prefix in prefixes), *above]


def remark_on_package(uri: str, path: Path, *, packages: Mapping[str, Path]) -> list[str]:
    """Return a list with a remark if the ``path`` of a mesh is in no folder with the name of its package."""
    parts = urlparse(uri)
    if parts.scheme != "package" or parts.netloc in packages or parts.netloc in path.parts:
        return []
    folder = str(path).removesuffix(unquote(parts.path))
    return [f"no folder has the name of the package {parts.netloc!r}; its meshes are taken from {folder}"]


def read_surface(uri: str, path: Path) -> Surface:
    """Return the vertices (n, 3) of a mesh file, in the file's unit, and its triangles (t, 3).

    COLLADA and glTF files state their unit; their vertices are in metres.

    Raises:
        ArmError: the file cannot be read.
    """
    try:
        vertices, triangles, _ = examine_surface(path, scale=1.0, closed=False, suffixes=LINK_SUFFIXES)
    except MeshError as error:
        raise ArmError(uri, error.defects) from error
    return vertices, triangles.astype(np.int64)


def convex_pieces(surface: Surface) -> tuple[list[Surface], int]:
    """Return the convex hull of each connected piece of a surface, and the number of pieces that are left out.

    Normals of the hulls' triangles point outward. Collision meshes often have a few stray triangles. A piece is left
    out if its hull is flat, or has less than `DEBRIS` of the largest hull's volume.

    Raises:
        MeshError: all pieces are flat.
    """
    vertices, triangles = surface
    hulls, numbers = [], shell_numbers(len(vertices), triangles)
    count = int(numbers.max()) + 1
    for number in range(count):
        try:
            hulls.append(ConvexHull(vertices[np.unique(triangles[numbers == number])]))
        except QhullError:
            continue  # this piece is flat, and is counted below
    if not hulls:
        text = "it is flat, and bounds no solid; remedy: close it, or leave it out of <collision>"
        raise MeshError("the collision mesh", [text])
    largest = max(hull.volume for hull in hulls)
    kept = [_outward(hull) for hull in hulls if hull.volume >= DEBRIS * largest]
    return kept, count - len(kept)


def _outward(hull: ConvexHull) -> Surface:
    used, flat = np.unique(hull.simplices, return_inverse=True)
    points, triangles = hull.points[used], flat.reshape(-1, 3).astype(np.int64)
    inward = cone_volumes(points, triangles) < 0.0
    triangles[inward] = triangles[inward][:, ::-1]
    return np.ascontiguousarray(points), triangles

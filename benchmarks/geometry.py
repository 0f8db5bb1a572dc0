# SPDX-License-Identifier: Apache-2.0
"""Triangle geometry of `gdfe_ros.mesh` beside trimesh, libigl and embree: ``python -m benchmarks.geometry``.

Each row has the least processor time of three runs, and the largest difference between the results. The surface is an
icosphere with 20480 triangles. libigl and embreex belong to no extra: ``pip install libigl embreex rtree``.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from gdfe_ros.mesh.box_tree import BoxTree
from gdfe_ros.mesh.shells import inertia_of, inside, points_inside
from gdfe_ros.mesh.surface_edges import refine
from gdfe_ros.mesh.triangle_kernels import first_hits, nearest_distances

CELLS = 32
"""Number of grid cells along the surface's diameter."""


def measure(call: Callable[[], Any]) -> tuple[float, Any]:
    """Return the least processor time of three calls [ms], after one that compiles, and the last result."""
    call()
    times = []
    for _ in range(3):
        start = time.process_time()
        result = call()
        times.append(time.process_time() - start)
    return 1e3 * min(times), result


def rows(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> Iterator[tuple[str, float, str, float, float]]:
    """Yield task, our time [ms], library, its time [ms], and the largest difference of the results, per row."""
    import igl

    cell = float(np.ptp(vertices, axis=0).max()) / CELLS
    start = vertices.min(axis=0) - 4 * cell
    shape = tuple(np.ceil(np.ptp(vertices, axis=0) / cell).astype(int) + 9)
    points = start + cell * np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    distances = np.empty(shape)

    def find_distances() -> None:
        tree = BoxTree.of(vertices, triangles)
        nearest_distances(points, tree.corners, tree.boxes, distances.reshape(-1))

    ours, _ = measure(find_distances)
    theirs, found = measure(lambda: igl.point_mesh_squared_distance(points, vertices, triangles))
    yield "distances of a grid", ours, "libigl", theirs, np.abs(np.sqrt(found[0]) - distances.ravel()).max()
    ours, grid = measure(lambda: points_inside((vertices - start) / cell, triangles, shape))
    theirs, found = measure(lambda: igl.fast_winding_number(vertices, triangles, points))
    yield "inside, of a grid", ours, "libigl", theirs, (grid.ravel() != (found > 0.5)).sum()
    some = points[:: len(points) // 200]
    ours, within = measure(lambda: inside(some, vertices, triangles))
    theirs, found = measure(lambda: igl.winding_number(vertices, triangles, some))
    yield "inside, 200 points", ours, "libigl", theirs, (within != (found > 0.5)).sum()
    ours, body = measure(lambda: inertia_of(vertices, triangles))
    theirs, found = measure(lambda: trimesh.Trimesh(vertices, triangles, process=False).mass_properties)
    yield "volume, centre, moments", ours, "trimesh", theirs, abs(found["volume"] / body.volume - 1.0)
    edge = 0.05 * float(np.ptp(vertices, axis=0).max())
    ours, found = measure(lambda: refine(vertices, triangles, 0.3 * edge))
    theirs, other = measure(lambda: trimesh.remesh.subdivide_to_size(vertices, triangles, 0.3 * edge, max_iter=20))
    yield "division to a length", ours, "trimesh", theirs, len(other[1]) / len(found[1]) - 1.0
    yield ray_row(vertices, triangles)


def ray_row(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> tuple[str, float, str, float, float]:
    """Return the row of inward rays from all triangles."""
    corners = np.ascontiguousarray(vertices[triangles])
    starts, normals = corners.mean(axis=1), np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = -normals / np.linalg.norm(normals, axis=1)[:, None]
    least = 1e-6 * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    lengths, hits = np.empty(len(starts)), np.empty(len(starts), np.int64)

    def shoot() -> None:
        tree = BoxTree.of(vertices, triangles)
        first_hits(starts, inward, tree.corners, tree.boxes, least, lengths, hits)

    def shoot_embree() -> NDArray[np.float64]:
        rays = trimesh.Trimesh(vertices, triangles, process=False).ray
        places, which, _ = rays.intersects_location(starts + least * inward, inward, multiple_hits=False)
        found = np.full(len(starts), np.inf)
        found[which] = np.linalg.norm(places - starts[which], axis=1)
        return found

    ours, _ = measure(shoot)
    theirs, found = measure(shoot_embree)
    return "first hits of rays", ours, "trimesh with embree", theirs, np.abs(found - lengths).max()


def main() -> int:
    """Print the table."""
    sphere = trimesh.creation.icosphere(subdivisions=5, radius=0.05)
    surface = np.ascontiguousarray(sphere.vertices), np.ascontiguousarray(sphere.faces, np.int64)
    for task, ours, library, theirs, difference in rows(*surface):
        print(f"{task:25s} ours {ours:8.1f} ms   {library:20s} {theirs:8.1f} ms   difference {difference:.2g}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

# SPDX-License-Identifier: Apache-2.0
"""Contents of STEP files: facts, bounds, facets of the surface, thickness of walls; read by gmsh in a process."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.existing_file import require_file
from gdfe_ros.mesh.mesher import run_mesher
from gdfe_ros.mesh.shells import shells
from gdfe_ros.mesh.walls import Walls, find_walls

STEP_SUFFIXES = (".step", ".stp")
FACETS_ALONG = 30.0
"""Number of facets along the longest side of a STEP file's solids."""


def step_bounds(path: str | Path) -> NDArray[np.float64]:
    """Return the lowest and the highest corner (2, 3) [m] of the bounding box of a STEP file's solids."""
    return _facts(path)["bounds"]


def step_volume(path: str | Path) -> float:
    """Return the volume [m^3] of a STEP file's solids."""
    return float(_facts(path)["volume"])


def step_facts(path: str | Path) -> list[tuple[str, str]]:
    """Return pairs (name, value) of texts about a STEP file: kind, solids, surfaces, bounds in metres, volume."""
    raw = _facts(path)
    return [
        ("kind", "STEP, to be filled with `mesh: {tets: {step: ...}}`"),
        ("solids, surfaces", f"{int(raw['solids'])}, {int(raw['surfaces'])}"),
        ("bounds in metres", _spans(*raw["bounds"])),
        ("volume", f"{float(raw['volume']):.6g} m^3"),
    ]


def solid_facts(
    path: str | Path, vertices: NDArray[np.float64], triangles: NDArray[np.int64], solid: NDArray[np.int64]
) -> list[tuple[str, str]]:
    """Return a pair (name, text) for each solid of a STEP file: its volume, cavities, and bounds in metres.

    Args:
        path: the STEP file.
        vertices: vertices (n, 3) [m] of the facets, as from `step_surface`.
        triangles: facets (t, 3).
        solid: number (t,) of the solid of each facet.
    """
    facts = []
    for k, name in enumerate(_facts(path)["names"]):
        own = triangles[solid == k]
        found, points = shells(vertices, own), vertices[np.unique(own)]
        inner = [volume for volume, depth in zip(found.volumes, found.depths, strict=True) if depth % 2]
        cavities = f"cavities {', '.join(f'{volume:.4g}' for volume in sorted(inner, reverse=True))} m^3"
        spans = _spans(points.min(axis=0), points.max(axis=0))
        text = f"{found.volume:.4g} m^3, {cavities if inner else 'no cavity'}, {spans}"
        facts.append((f"solid {k + 1} {str(name).rpartition('/')[2]}".rstrip(), text))
    return facts


def _spans(low: NDArray[np.float64], high: NDArray[np.float64]) -> str:
    return ", ".join(f"{axis} {a:.4g} to {b:.4g}" for axis, a, b in zip("xyz", low, high, strict=True))


def _facts(path: str | Path) -> dict[str, NDArray]:
    """Return solids, surfaces, bounds and volume of a STEP file."""
    path, heading = Path(path), f"step {path}"
    require_file(path, heading)
    return _read(path.resolve(), heading, path.stat().st_mtime_ns)


@lru_cache(maxsize=4)
def _read(path: Path, heading: str, changed: int) -> dict[str, NDArray]:
    """Read the facts of a STEP file that was last ``changed`` [ns]; each read starts a process with gmsh."""
    return run_mesher("facts", {"path": str(path)}, heading)


def step_surface(path: str | Path) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Return facets of a STEP file's solids: vertices (n, 3) [m], triangles (t, 3), and the number (t,) of their solid.

    The normals of the triangles point out of their solid. Where two solids touch, there is a triangle for each.
    """
    edge = float(np.ptp(step_bounds(path), axis=0).max()) / FACETS_ALONG
    heading = f"step {path}"
    raw = run_mesher("facets", {"path": str(Path(path).resolve()), "size": edge}, heading)
    if "triangles" not in raw:
        raise MeshError(heading, ["there is no solid in it; remedy: export the body as a solid, not as surfaces"])
    return raw["vertices"], raw["triangles"], raw["solid"]


def step_walls(path: str | Path, *, spacing: float) -> Walls:
    """Return the thickness of the walls of each solid of a STEP file, at places with a distance of ``spacing`` [m]."""
    vertices, triangles, solid = step_surface(path)
    return Walls.joined(
        [find_walls(vertices, triangles[solid == k], spacing=spacing) for k in range(int(solid.max()) + 1)]
    )

# SPDX-License-Identifier: Apache-2.0
"""The arm as a scene, and its tip under pressure in one chamber."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import yaml
from numpy.typing import NDArray

from benchmarks.measured_arm.section import LENGTH, OUTER, Section
from gdfe_ros import Command, Simulation
from gdfe_ros.scene import Scene, scene_from_text

MARKED = 21e-3
"""Radius at which the markers are on the end face [m]."""
PLACE = float(0.6 * OUTER / np.sqrt(2.0))
"""x and y of a point in the first chamber [m]."""


def arm_scene(
    folder: Path,
    section: Section,
    material: dict[str, Any],
    *,
    hoops: float = 0.0,
    dynamics: dict[str, Any] | None = None,
    gravity: float = 9.81,
) -> Scene:
    """Return the scene of the arm, which hangs along z. Its first chamber has the actuator ``air``.

    Args:
        folder: folder into which the mesh is written.
        section: cross-section of the arm.
        material: material law, as in a scene file.
        hoops: spacing of inextensible rings around the outer wall [m]; 0 for no rings.
        dynamics: time steps and damping, as in a scene file; None for equilibria.
        gravity: acceleration along the hanging arm [m/s^2]; 0 for an arm that is at rest in its drawn shape.
    """
    points, cells = section.hexahedra()
    file = folder / f"arm_{abs(hash((section, hoops))):x}.vtu"
    meshio.write(file, meshio.Mesh(points, [("hexahedron", cells)]))
    probes = {f"mark{k}": _mark(k) for k in range(4)}
    data = {
        "name": "measured_arm",
        "mesh": {"file": str(file)},
        "materials": {"silicone": material},
        "regions": [{"material": "silicone"}],
        "handles": {"base": {"where": {"box": {"z": [-1.0, 1e-6]}}, "fixed": True}},
        "actuators": {"air": {"chamber": {"near": [PLACE, PLACE, 0.5 * LENGTH], "command": "pressure"}}},
        "loads": {"weight": {"gravity": [0.0, 0.0, gravity]}},
        "probes": probes,
        "solver": {"tolerance": 1e-4},
    }
    if dynamics:
        data["dynamics"] = dynamics
    for k, z in enumerate(np.arange(0.5 * hoops, LENGTH, hoops) if hoops else []):
        ring = 0.998 * section.outline()
        places = np.column_stack([ring, np.full(len(ring), z)])
        data["actuators"][f"hoop{k}"] = {"cable": {"points": places.tolist(), "command": "shortening"}}
    return scene_from_text(yaml.safe_dump(data), origin="of the measured arm")


def tips(scene: Scene, *, step: float, most: float, actuator: str = "air") -> NDArray[np.float64]:
    """Return pressure [Pa], total displacement [m] and tilt [rad] of the tip, (k, 3), up to the last equilibrium.

    Args:
        scene: scene of the arm.
        step: increment of the pressure [Pa].
        most: largest pressure [Pa].
        actuator: name of the chamber under pressure.
    """
    simulation, found = Simulation(scene), [[0.0, 0.0, 0.0]]
    simulation.step()
    rest = marks(simulation)
    for pressure in np.arange(step, most + 0.5 * step, step):
        result = simulation.step(Command(actuators={actuator: float(pressure)}))
        if not result.converged or result.min_det <= 0.0:
            break
        now = marks(simulation)
        normal = np.cross(now[2] - now[0], now[3] - now[1])
        tilt = np.arccos(abs(normal[2]) / np.linalg.norm(normal))
        found.append([pressure, float(np.linalg.norm((now - rest).mean(axis=0))), tilt])
    return np.array(found)


def marks(simulation: Simulation) -> NDArray[np.float64]:
    """Return the positions (4, 3) [m] of the markers on the free end."""
    places = simulation.probe_positions()
    return np.array([places[f"mark{k}"] for k in range(4)])


def _mark(k: int) -> list[float]:
    angle = 0.5 * np.pi * k
    return [float(MARKED * np.cos(angle)), float(MARKED * np.sin(angle)), LENGTH]

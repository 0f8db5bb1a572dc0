# SPDX-License-Identifier: Apache-2.0
"""The films of docs/pick.md and the README: ``python -m docs.scripts.pick_film [SCENE ...]`` plays the programs, drawn.

Pictures are drawn by VTK without a window (the extra `gym`).
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyvista
from numpy.typing import NDArray
from PIL import Image

from gdfe_ros.analysis.scenery import obstacle_faces
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.live.surface import DrawnSurface
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation

IMAGES = Path(__file__).resolve().parents[1] / "images"
SIZE = 1280, 640
"""Size of a drawn picture [px]; a film has half of it, which smooths edges."""
EVERY = 10
"""Number of steps between two pictures of a film."""
WHOLE, NEAR = ((1.30, -1.10, 0.75), (0.19, 0.0, 0.22), 33.0), ((0.82, -0.26, 0.24), (0.44, 0.12, 0.085), 34.0)
"""Position and aim [m] and angle of view [degrees] of each half. The second one goes sideways with the hand."""
COLOURS = {
    "rubber": (0.93, 0.60, 0.20), "sheet": (0.35, 0.37, 0.40), "palm": (0.35, 0.37, 0.40), "ecoflex": (0.90, 0.35, 0.42)
}  # fmt: skip
"""Dict from material to its colour without strain."""
HOT, LARGEST = np.array([1.0, 0.97, 0.55]), 0.3
"""Colour at the largest equivalent strain, and this strain."""
TABLE, BOX, LINK = (0.93, 0.92, 0.90), (0.30, 0.50, 0.75), (0.78, 0.80, 0.84)


def draw_film(name: str) -> Path:
    """Play the program of a scene, draw every tenth step, and write an animation that repeats.

    Raises:
        RuntimeError: a step did not converge.
    """
    simulation = Simulation(load_scene(name))
    artist, pictures = Artist(simulation), []
    for number, result in enumerate(simulation.play(round(simulation.scene.program.duration / 0.01))):
        if not result.converged:
            raise RuntimeError(f"{name} at {result.time:g} s: {result.message}")
        if number % EVERY == 0:
            pictures.append(Image.fromarray(artist.picture()).resize((SIZE[0] // 2, SIZE[1] // 2), Image.LANCZOS))
    path, (first, *others) = IMAGES / f"{name}.webp", pictures
    first.save(path, save_all=True, append_images=others, duration=10 * EVERY, loop=0, quality=55, method=6)
    return path


class Artist:
    """Draws a simulation from two places, side by side; shapes are made once, and moved."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation, self._surface = simulation, DrawnSurface(simulation.mesh)
        materials = np.array([COLOURS[name] for name in simulation.scene.materials])[simulation.scene.cell_material]
        self._plain = np.column_stack([self._surface.outside.average(channel) for channel in materials.T])
        self._plotter = pyvista.Plotter(off_screen=True, window_size=SIZE, shape=(1, 2), border=False)
        self._plotter.set_background("white")
        self._body = _polygons(self._surface.outside.at(simulation.positions), self._surface.triangles)
        self._body["colour"] = self._colours()
        self._rigid = {each.name: _polygons(*_rows(self._faces(each))) for each in simulation.scene.rigid_bodies}
        self._links = []
        for half in range(2):
            self._plotter.subplot(0, half)
            self._add(self._body, scalars="colour", rgb=True)
            self._add(pyvista.Box((-0.25, 0.75, -0.4, 0.4, -0.02, -1e-4)), color=TABLE)
            for shape in self._rigid.values():
                self._add(shape, color=BOX)
            for visual in (each for arm in simulation.scene.arms for each in arm.visuals):
                look = {"color": visual.colour or LINK, "smooth_shading": True, "split_sharp_edges": True}
                self._links.append((visual.link, self._add(_polygons(*_rows(visual.faces)).clean(), **look)))

    def picture(self) -> NDArray[np.uint8]:
        """Return a picture (640, 1280, 3) of the present state."""
        simulation = self._simulation
        self._body.points = self._surface.outside.at(simulation.positions)
        self._body["colour"] = self._colours()
        for each in simulation.scene.rigid_bodies:
            self._rigid[each.name].points = _rows(self._faces(each))[0]
        frames, place = simulation.link_frames(), np.eye(4)
        for link, actor in self._links:
            place[:3, :3], place[:3, 3] = frames[link].axes, frames[link].origin
            actor.user_matrix = place.copy()
        sideways = np.array([0.0, simulation.handle_pose("palm").translation[1], 0.0])
        for half, (eye, aim, angle) in enumerate((WHOLE, NEAR)):
            self._plotter.subplot(0, half)
            self._plotter.camera_position = [eye + half * sideways, aim + half * sideways, (0.0, 0.0, 1.0)]
            self._plotter.camera.view_angle = angle
        self._plotter.render()
        return np.asarray(self._plotter.screenshot(return_img=True), dtype=np.uint8)

    def _add(self, shape: Any, **look: Any) -> Any:
        look |= {"reset_camera": False, "render": False, "show_scalar_bar": False, "ambient": 0.25}
        return self._plotter.add_mesh(shape, **look)

    def _colours(self) -> NDArray[np.uint8]:
        """Return the colours (n, 3) of the points of the body's surface: of the materials, brighter with strain."""
        strain = np.clip(self._surface.outside.average(self._simulation.fields().eps_eq) / LARGEST, 0.0, 1.0)[:, None]
        return (255.0 * ((1.0 - strain) * self._plain + strain * HOT)).astype(np.uint8)

    def _faces(self, body: RigidBody) -> NDArray[np.float64]:
        simulation = self._simulation
        return obstacle_faces(body, simulation.handle_pose(body.name), simulation.positions)


def _rows(faces: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return the points of faces (f, k, 3) [m], and the numbers of each face's points (f, k)."""
    count, corners = faces.shape[:2]
    return faces.reshape(-1, 3), np.arange(count * corners).reshape(count, corners)


def _polygons(points: NDArray[np.float64], ids: NDArray[np.integer]) -> Any:
    rows = np.column_stack([np.full(len(ids), ids.shape[1]), ids])
    return pyvista.PolyData(np.ascontiguousarray(points, dtype=float), rows.ravel())


def main(names: list[str]) -> None:
    """Draw the films of the scenes with these names, or of both, and print the names of the files."""
    for name in names or ("pick_ur5e", "pick_panda"):
        path = draw_film(name)
        print(f"written: {path} ({path.stat().st_size / 1e3:.0f} kB)")


if __name__ == "__main__":
    main(sys.argv[1:])

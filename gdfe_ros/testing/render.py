# SPDX-License-Identifier: Apache-2.0
"""Pictures of a simulation as arrays, drawn by VTK without a window: the view of the live page."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.analysis.scenery import Scenery
from gdfe_ros.colour_map import colour, colour_range
from gdfe_ros.errors import GdfeError
from gdfe_ros.simulation import Simulation

WIDTH, HEIGHT = 640, 480
"""Size of a picture in pixels."""
EYE = np.array([-0.55, -1.15, 0.65])
"""Position of the camera relative to the middle of the scene, divided by the scene's extent; as on the live page."""
ANGLE = 60.0
"""Vertical angle of view [degrees]."""
_OBSTACLE, _LINK, _CABLE, _CHAMBER = (0.55, 0.57, 0.61), (0.72, 0.74, 0.78), (0.75, 0.10, 0.10), (0.55, 0.80, 1.0)
_OPACITY = 0.45


class Painter:
    """Draws pictures of one simulation: body coloured by equivalent strain, obstacles, links of arms, cables, chambers.

    The camera keeps the position from which it shows the undeformed scene.

    Args:
        simulation: the simulation.

    Raises:
        GdfeError: pyvista is not installed.
    """

    def __init__(self, simulation: Simulation) -> None:
        try:
            self._library = import_module("pyvista")
        except ImportError as error:
            text = "render_mode 'rgb_array' needs pyvista, which is not installed"
            raise GdfeError(f"{text}; remedy: pip install 'gdfe_ros[gym]'") from error
        self._simulation = simulation
        self._outside = simulation.mesh.outside
        self._plotter = self._open()
        self._plotter.set_background("white")
        self._aim()

    def picture(self) -> NDArray[np.uint8]:
        """Return a picture (480, 640, 3) of the present state."""
        simulation = self._simulation
        self._plotter.clear_actors()
        values = self._outside.average(simulation.fields().eps_eq)
        shades = colour(values, *colour_range(float(values.min()), float(values.max())))
        body = self._polygons(self._outside.at(simulation.positions), self._outside.triangles)
        self._add(body, scalars=(255.0 * shades).astype(np.uint8), rgb=True, smooth_shading=False)
        scenery = Scenery.of(simulation)
        for faces in scenery.obstacles:
            self._add(self._faces(faces), color=_OBSTACLE, opacity=_OPACITY)
        for faces in scenery.chambers:
            self._add(self._faces(faces), color=_CHAMBER, opacity=_OPACITY)
        for points in scenery.cables:
            self._add(self._library.lines_from_points(points), color=_CABLE, line_width=3)
        self._add_arms()
        self._plotter.render()
        return np.asarray(self._plotter.screenshot(return_img=True), dtype=np.uint8)

    def close(self) -> None:
        """Release the memory of the picture."""
        self._plotter.close()

    def _open(self) -> Any:
        """Return a plotter. VTK's warning about a missing X server is suppressed, because no window is drawn."""
        logger = import_module("vtkmodules.vtkCommonCore").vtkLogger
        before = logger.GetCurrentVerbosityCutoff()
        logger.SetStderrVerbosity(logger.VERBOSITY_ERROR)
        try:
            return self._library.Plotter(off_screen=True, window_size=(WIDTH, HEIGHT), lighting="light kit")
        finally:
            logger.SetStderrVerbosity(before)

    def _aim(self) -> None:
        simulation = self._simulation
        places = [frame.origin for arm in simulation.scene.arms for frame in arm.rest.values()]
        places += [body.origin for body in simulation.scene.rigid_bodies]
        corners = np.vstack([simulation.mesh.bounds, *places])
        middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        extent = max(float(np.ptp(corners, axis=0).max()), simulation.mesh.extent)
        self._plotter.camera_position = [middle + extent * EYE, middle, (0.0, 0.0, 1.0)]
        self._plotter.camera.view_angle = ANGLE

    def _add(self, thing: Any, **look: Any) -> None:
        self._plotter.add_mesh(thing, reset_camera=False, render=False, show_scalar_bar=False, **look)

    def _add_arms(self) -> None:
        frames = self._simulation.link_frames() if self._simulation.scene.arms else {}
        for visual in (each for arm in self._simulation.scene.arms for each in arm.visuals):
            frame = frames[visual.link]
            placed = visual.faces @ frame.axes.T + frame.origin
            self._add(self._faces(placed), color=visual.colour or _LINK)

    def _faces(self, faces: NDArray[np.float64]) -> Any:
        """Return VTK's surface of faces (f, k, 3) [m]."""
        count, corners = faces.shape[:2]
        return self._polygons(faces.reshape(-1, 3), np.arange(count * corners).reshape(count, corners))

    def _polygons(self, points: NDArray[np.float64], ids: NDArray[np.integer]) -> Any:
        """Return VTK's surface of polygons with these corners (f, k) among the points."""
        return self._library.PolyData.from_regular_faces(np.ascontiguousarray(points), ids)

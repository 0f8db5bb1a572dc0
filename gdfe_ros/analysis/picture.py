# SPDX-License-Identifier: Apache-2.0
"""A picture of a deformed body coloured by an element field."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from numpy.typing import NDArray

from gdfe_ros.analysis.scenery import Scenery, face_values, force_arrows
from gdfe_ros.colour_map import colour_range
from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.meshing.surface_findings import SurfaceFindings

Surface = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
"""Faces (f, k, 3) [m], colours of the faces (f, 4), and colours of their edges (f, 4)."""
VIEW = {"elev": 18.0, "azim": -64.0}
COLOURS = "viridis"
LIGHT = np.array([0.35, -0.75, 0.65]) / np.linalg.norm([0.35, -0.75, 0.65])
SHADE = 0.35
OBSTACLE = (0.80, 0.62, 0.45, 0.35)
CABLE, FORCE = (0.75, 0.10, 0.10), (0.95, 0.15, 0.55)
CHAMBER, CHAMBER_EDGES = (0.55, 0.80, 1.0, 0.12), (0.75, 0.90, 1.0, 0.45)
PIECES = 24
"""Obstacles that are sorted together with the body have faces no longer than the body's size divided by this number.
Longer faces are divided, because matplotlib draws each face entirely in front of or behind another one."""
TICKS = 5
"""Number of intervals between ticks along the longest axis. Shorter axes have fewer, so that labels do not overlap."""


def draw_body(
    path: Path | BinaryIO,
    mesh: HexMesh,
    positions: NDArray[np.float64],
    values: NDArray[np.float64],
    *,
    title: str,
    label: str,
    limits: tuple[float, float] | None = None,
    around: NDArray[np.float64] | None = None,
    scenery: Scenery | None = None,
) -> None:
    """Draw the deformed surface of a body, coloured by values of its cells, with the undeformed bounding box.

    The surface is the skin of the mesh if it has one.

    Args:
        path: PNG file, or a binary file object.
        mesh: undeformed mesh.
        positions: positions of the vertices (n, 3) [m].
        values: values of the cells (m,).
        title: text above the picture.
        label: label of the colour bar.
        limits: values at both ends of the colour bar; None for the least and largest of ``values``. If they differ by
            less than `NOISE`, the body has one colour.
        around: points (k, 3) [m] that the axes must include, so that several pictures have one length scale.
        scenery: obstacles, cables, chambers and contact forces.

    Raises:
        OSError: the file cannot be written.
    """
    figure = Figure(figsize=(9.0, 5.0), dpi=150)
    axes = figure.add_axes((0.0, 0.05, 0.88, 0.88), projection="3d", computed_zorder=False)
    outside = mesh.outside
    faces = outside.at(positions)[outside.faces]
    colours = matplotlib.colormaps[COLOURS]
    norm = matplotlib.colors.Normalize(*colour_range(*(limits or (float(values.min()), float(values.max())))))
    lit = shade(colours(norm(face_values(mesh, values))), faces)
    edges = lit if outside.skin else np.tile((0.0, 0.0, 0.0, 0.25), (len(lit), 1))
    scenery = scenery or Scenery()
    _draw_surfaces(axes, (faces, lit, edges), positions, scenery.obstacles)
    axes.add_collection3d(Line3DCollection(_box_edges(mesh.bounds), colors="0.6", linewidths=0.7, linestyles="dashed"))
    largest = float(np.linalg.norm(scenery.forces, axis=1).max(initial=0.0))
    arrows = force_arrows(scenery.places, scenery.forces, largest=largest, size=mesh.size)
    _draw_inside(axes, scenery, arrows)
    shown = [solid.reshape(-1, 3) for solid in scenery.obstacles]
    frame(axes, np.vstack([positions, mesh.bounds, *shown, *([] if around is None else [around])]))
    if len(arrows):
        figure.text(0.98, 0.1, f"longest arrow: {largest:.3g} N", ha="right", fontsize=8, color=FORCE)
    bar = figure.colorbar(matplotlib.cm.ScalarMappable(norm, colours), cax=figure.add_axes((0.88, 0.2, 0.016, 0.55)))
    bar.set_label(label)
    figure.suptitle(title, x=0.04, y=0.96, ha="left", fontsize=12)
    figure.savefig(path, format="png" if not isinstance(path, Path) else None)


def _draw_surfaces(axes: Axes3D, body: Surface, positions: NDArray[np.float64], obstacles: list[NDArray]) -> None:
    """Draw the body and the obstacles. Obstacles no larger than the body are sorted, face by face, with the body."""
    size, drawn = float(np.ptp(positions, axis=0).max()), [body]
    for solid in obstacles:
        if np.ptp(solid.reshape(-1, 3), axis=0).max() <= size:
            drawn.append(_looks(_divide(solid, size / PIECES)))
            continue
        before = (solid.mean(axis=(0, 1)) - positions.mean(axis=0)) @ _towards_the_eye() > 0.0
        axes.add_collection3d(obstacle_collection(solid, zorder=2 if before else 0))
    # Faces of one collection are drawn from the farthest to the nearest.
    faces, colours, edges = zip(*drawn, strict=True)
    polygons = [face for part in faces for face in part]
    look = {"facecolors": np.vstack(colours), "edgecolors": np.vstack(edges), "linewidths": 0.3}
    axes.add_collection3d(Poly3DCollection(polygons, **look, zorder=1, clip_on=False))


def obstacle_collection(faces: NDArray[np.float64], *, zorder: float = 0.0) -> Poly3DCollection:
    """Return a matplotlib collection of an obstacle's faces (f, k, 3) [m], pale and translucent."""
    _, colours, edges = _looks(faces)
    look = {"facecolors": colours, "edgecolors": edges, "linewidths": 0.2, "clip_on": False, "zorder": zorder}
    return Poly3DCollection(faces, **look)


def _looks(faces: NDArray[np.float64]) -> Surface:
    """Return the faces (f, k, 3) [m] of an obstacle with the colours of the faces and of their edges."""
    colours = shade(np.tile(OBSTACLE, (len(faces), 1)), faces)
    return faces, colours, np.tile((0.0, 0.0, 0.0, 0.08), (len(faces), 1))


def _divide(faces: NDArray[np.float64], length: float) -> NDArray[np.float64]:
    """Return quads (f, 4, 3) [m] divided into pieces no longer than ``length`` [m]; triangles stay whole."""
    count = int(np.ceil(np.linalg.norm(faces - np.roll(faces, 1, axis=1), axis=2).max() / length))
    if faces.shape[1] != 4 or count < 2:
        return faces
    t = np.linspace(0.0, 1.0, count + 1)[None, :, None, None]
    a, b, c, d = (faces[:, k, None, None] for k in range(4))
    s = t.transpose(0, 2, 1, 3)
    grid = (1 - s) * ((1 - t) * a + t * d) + s * ((1 - t) * b + t * c)
    corners = grid[:, :-1, :-1], grid[:, :-1, 1:], grid[:, 1:, 1:], grid[:, 1:, :-1]
    return np.stack(corners, axis=3).reshape(-1, 4, 3)


def _draw_inside(axes: Axes3D, scenery: Scenery, arrows: NDArray[np.float64]) -> None:
    """Draw cables, chambers and forces over the body, as if it were transparent."""
    for faces in scenery.chambers:
        look = {"facecolors": CHAMBER, "edgecolors": CHAMBER_EDGES, "linewidths": 0.4}
        axes.add_collection3d(Poly3DCollection(faces, **look, clip_on=False, zorder=3))
    over = {"clip_on": False, "zorder": 4}
    for cable in scenery.cables:
        axes.plot(*cable.T, linewidth=1.4, marker="o", markersize=2.0, color=CABLE, **over)
    if len(arrows):
        axes.add_collection3d(Line3DCollection(arrows, colors=FORCE, linewidths=1.2, **over))
        axes.plot(*arrows[:, 1].T, linestyle="none", marker="o", markersize=2.5, color=FORCE, **over)


def shade(colours: NDArray[np.float64], faces: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the ``colours`` (q, 4) of triangles or quads (q, 3 or 4, 3), shaded by a light from the upper left."""
    normals = np.cross(faces[:, 2] - faces[:, 0], faces[:, -1] - faces[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-300
    brightness = 1.0 - SHADE + SHADE * np.clip(normals @ LIGHT, -1.0, 1.0)
    shaded = colours.copy()
    shaded[:, :3] *= brightness[:, None]
    return np.clip(shaded, 0.0, 1.0)


def _towards_the_eye() -> NDArray[np.float64]:
    elevation, azimuth = np.deg2rad([VIEW["elev"], VIEW["azim"]])
    flat = np.cos(elevation)
    return np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])


def _box_edges(bounds: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    corners = np.array([[bounds[(i >> axis) & 1, axis] for axis in range(3)] for i in range(8)])
    pairs = [(i, i | 1 << axis) for i in range(8) for axis in range(3) if not i >> axis & 1]
    return [corners[list(pair)] for pair in pairs]


def frame(axes: Axes3D, points: NDArray[np.float64]) -> None:
    """Set the limits, the ticks and the view of axes so that they show all ``points`` (k, 3) [m] to scale."""
    low, high = points.min(axis=0), points.max(axis=0)
    span = np.maximum(high - low, 0.05 * (high - low).max())
    middle = 0.5 * (low + high)
    for name, centre, width in zip("xyz", middle, span, strict=True):
        getattr(axes, f"set_{name}lim")(centre - 0.5 * width, centre + 0.5 * width)
        getattr(axes, f"set_{name}label")(f"{name} [m]", fontsize=8)
    axes.set_box_aspect(span, zoom=1.0)
    axes.tick_params(labelsize=7)
    for name, width in zip("xyz", span, strict=True):
        bins = max(1, round(TICKS * width / span.max()))
        locator = MaxNLocator(nbins=bins, min_n_ticks=min(3, bins), steps=[1, 2, 5, 10])
        getattr(axes, f"{name}axis").set_major_locator(locator)
    axes.view_init(**VIEW)


PLAIN, DEFECT = (0.75, 0.78, 0.82, 1.0), (0.85, 0.10, 0.10, 1.0)
"""Colours of a surface whose thickness is unknown, and of defects."""
THICKEST = 3.0
"""Thickness at the end of the colour bar, divided by the size of the cells."""


def draw_surface(path: Path | BinaryIO, found: SurfaceFindings, *, title: str) -> None:
    """Draw a surface.

    Walls are coloured by their thickness, up to `THICKEST` times the size of the cells; a cross marks the thinnest
    place. Triangles that are cut by others, places where they cut each other, and edges that are open or wound wrongly
    are red. Places and edges are drawn over the surface, as if it were transparent.

    Args:
        path: PNG file, or a binary file object.
        found: findings on the surface.
        title: text above the picture.

    Raises:
        OSError: the file cannot be written.
    """
    figure = Figure(figsize=(9.0, 5.0), dpi=150)
    axes = figure.add_axes((0.0, 0.05, 0.88, 0.88), projection="3d", computed_zorder=False)
    corners = found.vertices[found.triangles]
    faces, colours = corners, np.tile(PLAIN, (len(corners), 1))
    if found.walls is not None:
        scale = matplotlib.colors.Normalize(0.0, THICKEST * found.size)
        mapped = matplotlib.cm.ScalarMappable(scale, matplotlib.colormaps[COLOURS])
        faces, colours = found.walls.corners, mapped.to_rgba(np.minimum(found.walls.thickness, scale.vmax))
        bar = figure.colorbar(mapped, cax=figure.add_axes((0.88, 0.2, 0.016, 0.55)), extend="max")
        bar.set_label("thickness of the wall [m]")
    cut = corners[found.cuts.cut]
    faces = np.concatenate([faces, cut])
    colours = shade(np.concatenate([colours, np.tile(DEFECT, (len(cut), 1))]), faces)
    axes.add_collection3d(Poly3DCollection(faces, facecolors=colours, edgecolors=colours, linewidths=0.3, zorder=1))
    over = {"color": DEFECT, "zorder": 4}
    wrong = found.wrong_edges
    if len(wrong):
        axes.add_collection3d(Line3DCollection(wrong, linewidths=1.5, **over))
    _mark(axes, found.cuts.places, marker="o", **over)
    if found.walls is not None and np.isfinite(found.walls.thickness).any():
        _mark(axes, found.walls.places[[found.walls.thinnest]], marker="x", color="black", zorder=5)
    frame(axes, found.vertices)
    figure.suptitle(f"{title}, {found.cuts.pairs} pairs cut each other", x=0.04, y=0.96, ha="left", fontsize=12)
    figure.savefig(path, format="png" if not isinstance(path, Path) else None)


def _mark(axes, places: NDArray[np.float64], **look) -> None:
    """Draw a mark at each place (k, 3) [m]."""
    axes.plot(*places.T, linestyle="none", markersize=5.0 if look["marker"] == "x" else 1.5, clip_on=False, **look)

# SPDX-License-Identifier: Apache-2.0
"""A picture of a surface coloured by the thickness of its walls, with its defects in red."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from numpy.typing import NDArray

from gdfe_ros.analysis.picture import COLOURS, frame, shaded
from gdfe_ros.mesh.surface_findings import SurfaceFindings

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
    colours = shaded(np.concatenate([colours, np.tile(DEFECT, (len(cut), 1))]), faces)
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

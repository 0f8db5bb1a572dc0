# SPDX-License-Identifier: Apache-2.0
"""A workspace as a table and as a picture."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from gdfe_ros.analysis.workspace import ReachableSet
from gdfe_ros.bounded_text import quoted

_PAIRS = (("x", "z", 0, 2), ("y", "z", 1, 2), ("x", "y", 0, 1))


def workspace_rows(found: ReachableSet) -> list[tuple[str, str]]:
    """Return the results as pairs of name and text."""
    points = found.points[found.reached]
    rows = [("commands", f"{len(found.points)} of {', '.join(found.actuators)}"), ("reached", f"{len(points)}")]
    if len(points):
        farthest = float(np.linalg.norm(points - found.rest, axis=1).max())
        rows += [
            *((f"{axis} [m]", f"{low:.5g} to {high:.5g}") for axis, low, high in
              zip("xyz", points.min(axis=0), points.max(axis=0), strict=True)),
            ("farthest from rest [m]", f"{farthest:.5g}"),
            ("volume of the convex hull [m^3]", f"{found.volume:.4g}" if found.volume else "none: a line or a sheet"),
        ]  # fmt: skip
    return rows


def write_workspace(path: Path, found: ReachableSet) -> None:
    """Write a row for each command: commands, position [m], and the reason if there is no equilibrium.

    Raises:
        OSError: the file cannot be written.
    """
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*(f"command.{name}" for name in found.actuators), "x [m]", "y [m]", "z [m]", "message"])
        for command, point, message in zip(found.commands, found.points, found.messages, strict=True):
            places = ["" if np.isnan(value) else f"{value:.9g}" for value in point]
            writer.writerow([*(f"{value:.9g}" for value in command), *places, quoted(message)])


def draw_workspace(path: Path, found: ReachableSet, *, title: str) -> None:
    """Draw the points in 3-D and in three projections, coloured by the first command.

    Raises:
        OSError: the picture cannot be written.
    """
    figure = Figure(figsize=(9.5, 8.0), dpi=120, layout="constrained")
    points, colours = found.points[found.reached], found.commands[found.reached][:, 0]
    style = {"c": colours, "cmap": "viridis", "s": 9}
    space = figure.add_subplot(2, 2, 1, projection="3d")
    drawn = space.scatter(*points.T, **style)
    space.scatter(*found.rest, color="#c2562d", marker="x", s=40)
    space.set_aspect("equal")
    space.tick_params(labelsize=6)
    for number, (across, up, first, second) in enumerate(_PAIRS, 2):
        axes = figure.add_subplot(2, 2, number)
        axes.scatter(points[:, first], points[:, second], **style)
        axes.plot(found.rest[first], found.rest[second], "x", color="#c2562d", label="undeformed")
        axes.set_xlabel(f"{across} [m]")
        axes.set_ylabel(f"{up} [m]")
        axes.set_aspect("equal", adjustable="datalim")
        axes.grid(color="0.93")
    axes.legend(frameon=False, fontsize=8)
    figure.colorbar(drawn, ax=figure.axes, label=found.actuators[0], shrink=0.5)
    figure.suptitle(title, fontsize=11)
    figure.savefig(path)

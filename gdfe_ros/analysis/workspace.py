# SPDX-License-Identifier: Apache-2.0
"""The points that a probe reaches over the ranges of the actuators; as a table and as a picture."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError
from scipy.stats import qmc

from gdfe_ros.analysis.workers import map_tasks
from gdfe_ros.errors import GdfeError, require_named
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene import Scene, scene_from_text
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.untrusted.bounded_text import quote_formula

if TYPE_CHECKING:
    from distributed import Client

FLAT = 1e-3
"""Thickness of a point cloud, divided by its length, below which the cloud is a line or a sheet without volume."""
CLOSE = 1e-3
"""Largest distance to the equilibrium, divided by the body's size, at which a position counts as reached."""
RETRIES = 8
"""Number of equal steps from the initial state to a command that could not be reached from the previous command."""
LONG = 1e6
"""Duration of a step [s]; it is so long that no rate limit restricts a command."""
PART = 25
"""Number of successive commands of a task. Each task starts from the initial state. If a worker dies, its task is
repeated. The number does not depend on the number of workers; therefore the points do not, either.
"""
MOST_GRID = 2
"""Largest number of actuators for which the commands are a grid. For more actuators, see `command_samples`."""


@dataclass(frozen=True, eq=False)
class ReachableSet:
    """Commands, and the points that a probe reaches with them.

    Attributes:
        probe: name of the probe.
        actuators: names (a,).
        commands: (k, a) in the unit of each actuator.
        points: positions of the probe (k, 3) [m]; NaN for a command without an equilibrium.
        rest: position of the probe in the undeformed body (3,) [m].
        messages: (k,) reason why no equilibrium was found for a command; empty if one was found.
    """

    probe: str
    actuators: tuple[str, ...]
    commands: NDArray[np.float64]
    points: NDArray[np.float64]
    rest: NDArray[np.float64]
    messages: tuple[str, ...]

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Whether an equilibrium was found for each command (k,)."""
        return np.isfinite(self.points).all(axis=1)

    @property
    def volume(self) -> float:
        """Volume [m^3] of the convex hull of the points; 0 for points on a line or a sheet."""
        points = self.points[self.reached]
        if len(points) < 4:
            return 0.0
        spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        if spread[-1] < FLAT * spread[0]:
            return 0.0
        try:
            return float(ConvexHull(points).volume)
        except QhullError:
            return 0.0


def ranges(scene: Scene, names: Sequence[str], given: dict[str, tuple[float, float]]) -> NDArray[np.float64]:
    """Return the least and largest command (a, 2) of the actuators ``names``, from ``given`` or from the scene.

    Raises:
        GdfeError: there is no such actuator, its range is not finite, a given range is empty or exceeds that of the
            scene, or a range is given for an actuator that is not in ``names``.
    """
    known = {actuator.name: actuator for actuator in scene.actuators}
    for name in (*names, *given):
        require_named("actuator", name, known, f" in scene {scene.name!r}")
    if unused := [name for name in given if name not in names]:
        raise GdfeError(f"--range {unused[0]}: this actuator keeps its neutral command; add it to --actuators")
    found = [given.get(name, (known[name].low, known[name].high)) for name in names]
    for name, (low, high) in zip(names, found, strict=True):
        if not (math.isfinite(low) and math.isfinite(high)):
            text = f"actuator {name!r} has the range {low:g} to {high:g}, which must be finite"
            raise GdfeError(f"{text}; remedy: `range` in the scene, or --range {name}=LOW..HIGH")
        if not known[name].low <= low < high <= known[name].high:
            text = f"--range {name}={low:g}..{high:g}; allowed: from {known[name].low:g} to {known[name].high:g}"
            raise GdfeError(f"{text}, the first below the second")
    return np.array(found)


def command_samples(limits: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return about ``count`` commands (k, a) that fill the ranges (a, 2).

    For up to `MOST_GRID` actuators the commands are a grid. For more actuators they are points of Sobol's sequence, and
    also the corners of the ranges if these are at most half of the commands. Each command is close to the previous one,
    because the solver starts from the previous equilibrium.
    """
    dimensions = len(limits)
    if dimensions <= MOST_GRID:
        side = max(2, round(count ** (1.0 / dimensions)))
        axes = [np.linspace(low, high, side) for low, high in limits]
        grid = np.array(list(product(*axes))).reshape(*[side] * dimensions, dimensions)
        if dimensions == 2:
            grid[1::2] = grid[1::2, ::-1]  # to and fro
        return grid.reshape(-1, dimensions)
    corners = np.zeros((0, dimensions))
    if 2 ** (dimensions + 1) <= count:
        corners = np.array(list(product((0.0, 1.0), repeat=dimensions)))
    rest = count - len(corners)
    inside = qmc.Sobol(dimensions, scramble=False).random(1 << math.ceil(math.log2(rest + 1)))[1 : rest + 1]
    unit = np.concatenate([corners, inside])
    return limits[:, 0] + unit[_tour(unit)] * (limits[:, 1] - limits[:, 0])


def _tour(unit: NDArray[np.float64]) -> list[int]:
    """Return an order of points (k, a) in which each point is followed by the nearest remaining point."""
    left, order = set(range(1, len(unit))), [0]
    while left:
        places = np.array(sorted(left))
        nearest = int(places[np.argmin(np.linalg.norm(unit[places] - unit[order[-1]], axis=1))])
        order.append(nearest)
        left.remove(nearest)
    return order


def find_workspace(
    scene: Scene, probe: str, actuators: Sequence[str], commands: NDArray[np.float64], *, client: Client | None = None
) -> ReachableSet:
    """Return the positions of a probe at the equilibrium of each command.

    Args:
        scene: the scene; its dynamics are switched off.
        probe: name of the probe.
        actuators: names (a,); the other actuators keep their neutral commands.
        commands: (k, a) in the unit of each actuator.
        client: client of the workers (`gdfe_ros.analysis.workers.connect`); None computes in this process.

    Raises:
        GdfeError: there is no such probe, or the workers die.
    """
    require_named("probe", probe, scene.probes, f" in scene {scene.name!r}")
    parts = [commands[start : start + PART] for start in range(0, len(commands), PART)]
    results = map_tasks(client, partial(_reach, scene.source, probe, tuple(actuators)), parts)
    points = np.concatenate([places for places, _ in results])
    messages = tuple(text for _, texts in results for text in texts)
    rest = scene.probes[probe].at(scene.mesh.vertices)[0]
    return ReachableSet(probe, tuple(actuators), commands, points, rest, messages)


def _reach(
    text: str, probe: str, names: tuple[str, ...], commands: NDArray[np.float64]
) -> tuple[NDArray[np.float64], list[str]]:
    """Return a probe's positions (k, 3) [m] and messages (k,) for successive commands; NaN without an equilibrium."""
    simulation = Simulation(scene_from_text(text, origin="of the workspace", overrides={"dynamics": None}))
    neutral = dict(simulation.rest_command().actuators)
    points, messages = np.full((len(commands), 3), np.nan), []
    for row, command in enumerate(commands):
        values = dict(zip(names, map(float, command), strict=True))
        result = simulation.step(Command(actuators=values), dt=LONG)
        if not _near(result):
            simulation.reset()
            for share in np.linspace(0.0, 1.0, RETRIES + 1)[1:]:
                part = {name: share * value + (1.0 - share) * neutral[name] for name, value in values.items()}
                result = simulation.step(Command(actuators=part), dt=LONG)
        if _near(result):
            points[row] = simulation.probe_positions()[probe]
        else:
            simulation.reset()
        messages.append("" if _near(result) else result.message or "no equilibrium was found")
    return points, messages


def _near(result: StepResult) -> bool:
    """Return whether the step converged, or came within `CLOSE` of the equilibrium without inverted cells."""
    return result.converged or (result.error_estimate <= CLOSE and result.min_det > 0.0)


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
            writer.writerow([*(f"{value:.9g}" for value in command), *places, quote_formula(message)])


def draw_workspace(path: Path, found: ReachableSet, *, title: str) -> None:
    """Draw the points in 3-D and in three projections, coloured by the first command.

    Raises:
        OSError: the picture cannot be written.
    """
    from matplotlib.figure import Figure  # workers need no matplotlib

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

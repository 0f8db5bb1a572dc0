# SPDX-License-Identifier: Apache-2.0
"""Small strains with few cells across: bars that are twisted or bent, a rubber pad between plates, a tube.

The argument ``across`` is the number of cells over the bar's side, the pad's height or the tube's wall.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.command import Command
from gdfe_ros.constraints import Axis, Pose
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.mesh.files.stored_mesh import pack_mesh
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.settings import Torsion
from test.written import advance, scene_of

Array = NDArray[np.float64]
Reactions = Mapping[str, Array]
YOUNG = 1e5
"""Young's modulus of every body [Pa]."""
SIDE = 0.02
"""Common value of the bar's side, the pad's height, the tube's inner radius and the thickness of its wall [m]."""
SLENDERNESS, TURN = 6, 1e-3
"""Length of the bar divided by its width, and rotation of each end [rad]."""
MIDDLE = 0.25
"""Middle fraction of the bar's length over which twist and curvature are measured, away from the clamped ends."""
SAINT_VENANT = {1: 0.14057702, 2: 0.45736336}
"""Dict from width / thickness to the torsion constant divided by thickness^4 (Timoshenko and Goodier)."""
WIDTH, PRESSED = 4, 1e-4
"""Width of the pad divided by its height, and compression of the pad divided by its height."""
PAD = 3.108
"""Mean stress / (E * mean strain) of the pad, to which FElupe's triquadratic hexahedra converge with refinement."""
CONFINED = 0.495
"""Poisson's ratio of the pad and of the tube."""
AROUND, PRESSURE = 8, 10.0
"""Number of cells around the tube divided by the number through its wall, and internal pressure [Pa]."""


@dataclass(frozen=True)
class Held:
    """Vertices (k,) that are moved like a rigid body, and axes along which they slide without a force."""

    vertices: NDArray[np.int32]
    pose: Pose = field(default_factory=Pose)
    free: tuple[Axis, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A linear elastic body, its constraints, and the measured quantity.

    Attributes:
        mesh: mesh of the body.
        poisson: Poisson's ratio.
        held: dict from name to held vertices.
        forces: dead forces on the vertices (n, 3) [N]; None if there are none.
        measure: function from the displacements (n, 3) [m] and the wrenches (6,) of the held vertices to the measured
            quantity divided by its exact value.
    """

    mesh: HexMesh
    poisson: float
    held: Mapping[str, Held]
    measure: Callable[[Array, Reactions], float]
    forces: Array | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class NodalForces:
    """A load with a force on each vertex, ``values`` (n, 3) [N]."""

    name: str
    values: Array

    def forces(self, rest: Array, cells: Array) -> Array:
        """Return the force at each vertex (n, 3) [N]."""
        return self.values


def error(name: str, across: int, torsion: Torsion = Torsion.CELL) -> float:
    """Return the relative error of the problem ``name`` with ``across`` cells across."""
    problem = PROBLEMS[name](across)
    handles = {
        name: {"where": {"vertices": held.vertices.tolist()}, "free": [axis.name.lower() for axis in held.free]}
        for name, held in problem.held.items()
    }
    soft = f"materials: {{soft: {{law: linear, young: {YOUNG}, poisson: {problem.poisson}}}}}"
    solver = {"tolerance": 1e-9, "max_iterations": 20_000, "torsion": torsion.value}
    scene = scene_of(soft, mesh={"embedded": pack_mesh(problem.mesh)}, handles=handles, solver=solver)
    if problem.forces is not None:
        scene = replace(scene, loads=(NodalForces(name="forces", values=problem.forces),))
    simulation = Simulation(scene)
    result = advance(simulation, Command(handles={name: held.pose for name, held in problem.held.items()}))
    return problem.measure(result.positions - problem.mesh.vertices, result.reactions) - 1.0


def twisted(across: int, width: int = 1) -> Problem:
    """Return the torsion of a bar ``width`` times as wide as thick; measured: torque / (G J * twist rate)."""
    mesh = _bar(across, width)
    shear = YOUNG / 2.6

    def measure(moved: Array, reactions: Reactions) -> float:
        chosen, (x, y, z) = _middle(mesh, across)
        own = moved[chosen]
        turned = (y * own[:, 2] - z * own[:, 1]) / (y * y + z * z).clip(1e-30)
        off_axis = y * y + z * z > 0.0
        twist = np.polyfit(x[off_axis], turned[off_axis], 1)[0]
        torque = 0.5 * (reactions["right"][3] - reactions["left"][3])
        return float(torque / (shear * SAINT_VENANT[width] * SIDE**4 * twist))

    return Problem(mesh=mesh, poisson=0.3, held=_turned_ends(mesh, (-TURN, 0.0, 0.0)), measure=measure)


def bending(across: int, poisson: float = 0.3) -> Problem:
    """Return the bending of a square bar by rotations of its ends; measured: moment / (E I * curvature)."""
    mesh = _bar(across)

    def measure(moved: Array, reactions: Reactions) -> float:
        chosen, (x, _, z) = _middle(mesh, across)
        terms = np.stack([np.ones_like(x), x, z, x * z], axis=1)
        scale = terms.max(axis=0)
        slopes = np.linalg.lstsq(terms / scale, moved[chosen, 0], rcond=None)[0] / scale
        moment = 0.5 * (reactions["right"][4] - reactions["left"][4])
        return float(moment / (YOUNG * SIDE**4 / 12.0 * slopes[3]))

    return Problem(mesh=mesh, poisson=poisson, held=_turned_ends(mesh, (0.0, -TURN, 0.0)), measure=measure)


def pad(across: int) -> Problem:
    """Return the compression of a pad that is bonded to two plates; measured: its stiffness."""
    mesh = bar([WIDTH * SIDE, WIDTH * SIDE, SIDE], [WIDTH * across, WIDTH * across, across])
    height = mesh.vertices[:, 2]
    held = {
        "low": Held(_ids(np.isclose(height, height.min()))),
        "high": Held(_ids(np.isclose(height, height.max())), Pose(translation=(0.0, 0.0, -PRESSED * SIDE))),
    }

    def measure(moved: Array, reactions: Reactions) -> float:
        return float(-reactions["high"][2] / (PAD * YOUNG * PRESSED * (WIDTH * SIDE) ** 2))

    return Problem(mesh=mesh, poisson=CONFINED, held=held, measure=measure)


def tube(across: int) -> Problem:
    """Return the inflation of a short tube with free ends (Lame's solution); measured: growth of the inner radius."""
    around = AROUND * across
    layers = bar([1.0, 1.0, SIDE / across], [across, around, 1])
    share, angle = layers.vertices[:, 0] - layers.vertices[:, 0].min(), 2.0 * np.pi * layers.vertices[:, 1]
    radius = SIDE * (1.0 + share)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), layers.vertices[:, 2]], axis=1)
    _, first, same = np.unique(np.round(points / SIDE, 9), axis=0, return_index=True, return_inverse=True)
    mesh = HexMesh(points[first], same.ravel()[layers.cells].astype(np.int32))
    radius = np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1])
    inner, outer = SIDE, 2.0 * SIDE
    wall = np.isclose(radius, inner)
    outward = mesh.vertices * (1.0, 1.0, 0.0) / radius[:, None]
    # Each vertex has half of the pressure force of two facets. The sum is radial and has the sine of the chord's angle.
    size = PRESSURE * inner * np.sin(2.0 * np.pi / around) * 0.5 * SIDE / across
    growth = PRESSURE / YOUNG * inner**2 / (outer**2 - inner**2)
    exact = growth * ((1.0 - CONFINED) * inner + (1.0 + CONFINED) * outer**2 / inner)

    def measure(moved: Array, reactions: Reactions) -> float:
        return float(np.mean(np.sum(moved * outward, axis=1)[wall]) / exact)

    return Problem(
        mesh=mesh,
        poisson=CONFINED,
        held=_three_points(mesh, outer),
        measure=measure,
        forces=size * outward * wall[:, None],
    )


PROBLEMS: dict[str, Callable[[int], Problem]] = {
    "torsion": twisted,
    "torsion 2:1": lambda across: twisted(across, 2),
    "bending": bending,
    "bending, nu 0.495": lambda across: bending(across, CONFINED),
    "pad": pad,
    "tube": tube,
}
"""Dict from name to the function that returns a problem with a number of cells across."""


def _bar(across: int, width: int = 1) -> HexMesh:
    length = SLENDERNESS * width
    return bar([length * SIDE, width * SIDE, SIDE], [length * across, width * across, across])


def _ids(chosen: Array) -> np.ndarray:
    return np.flatnonzero(chosen).astype(np.int32)


def _turned_ends(mesh: HexMesh, turn: tuple[float, float, float]) -> dict[str, Held]:
    x = mesh.vertices[:, 0]
    ends = {"left": np.isclose(x, x.min()), "right": np.isclose(x, x.max())}
    return {
        name: Held(_ids(end), Pose(rotation=tuple(sign * part for part in turn)))
        for (name, end), sign in zip(ends.items(), (1.0, -1.0), strict=True)
    }


def _middle(mesh: HexMesh, across: int) -> tuple[Array, Array]:
    """Return whether each vertex is in the middle of the bar (n,), and positions (3, k) [m] of these k vertices."""
    places = mesh.vertices - mesh.bounds.mean(axis=0)
    half = np.abs(places[:, 0]).max()
    chosen = np.abs(places[:, 0]) < MIDDLE * half + 0.6 * SIDE / across
    return chosen, places[chosen].T


def _three_points(mesh: HexMesh, radius: float) -> dict[str, Held]:
    """Return constraints on three vertices of a tube that prevent rigid motion but no deformation."""
    low = mesh.vertices[:, 2].min()
    places = {"east": (radius, 0.0, low), "west": (-radius, 0.0, low), "north": (0.0, radius, low)}
    free = {"east": (), "west": (Axis.X,), "north": (Axis.X, Axis.Y)}
    distance = {name: np.linalg.norm(mesh.vertices - place, axis=1) for name, place in places.items()}
    return {name: Held(_ids(found < 1e-9), free=free[name]) for name, found in distance.items()}

# SPDX-License-Identifier: Apache-2.0
"""The bodies: a square bar that is twisted or bent, a rubber pad between plates, a thick tube under pressure.

Each takes the number of cells across: over the bar's side, the pad's height, the tube's wall.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.coarse_meshes.problem import YOUNG, Array, Found, Held, Problem
from gdfe_ros.constraints import Axis, Pose
from gdfe_ros.mesh import HexMesh, bar

SIDE = 0.02
"""Side of the bar, height of the pad, and inner radius and wall of the tube [m]."""
SLENDERNESS, TURN = 6, 1e-3
"""Length of the bar over its width, and the angle by which each end is turned [rad]."""
MIDDLE = 0.25
"""Fraction of the bar's length, about its middle, over which twist and curvature are measured: ends are clamped."""
SAINT_VENANT = {1: 0.14057702, 2: 0.45736336}
"""Torsion constant over the fourth power of the thickness, by width over thickness (Timoshenko and Goodier)."""
WIDTH, PRESSED = 4, 1e-4
"""Width of the pad over its height, and the fraction of the height by which it is pressed together."""
PAD = 3.108
"""Mean stress over E times the mean strain of the pad: what FElupe's triquadratic hexahedra tend to on ever finer
cells, as ``python -m benchmarks.coarse_meshes --reference`` prints it."""
CONFINED = 0.495
"""Poisson's ratio of the pad and of the tube."""
AROUND, PRESSURE = 8, 10.0
"""Cells around the tube over those through its wall, and the pressure in it [Pa]."""


def torsion(across: int, width: int = 1) -> Problem:
    """Twist a bar ``width`` times as wide as it is thick: torque over G J times the twist in the middle."""
    mesh = _bar(across, width)
    shear = YOUNG / 2.6

    def measure(found: Found) -> float:
        chosen, (x, y, z) = _middle(mesh, across)
        moved = found.displacement[chosen]
        turned = (y * moved[:, 2] - z * moved[:, 1]) / (y * y + z * z).clip(1e-30)
        off_axis = y * y + z * z > 0.0
        twist = np.polyfit(x[off_axis], turned[off_axis], 1)[0]
        torque = 0.5 * (found.reactions["right"][3] - found.reactions["left"][3])
        return float(torque / (shear * SAINT_VENANT[width] * SIDE**4 * twist))

    return Problem(mesh=mesh, poisson=0.3, held=_turned_ends(mesh, (-TURN, 0.0, 0.0)), measure=measure)


def bending(across: int, poisson: float = 0.3) -> Problem:
    """Bend a square bar by turning its ends: moment over E I times the curvature in the middle."""
    mesh = _bar(across)

    def measure(found: Found) -> float:
        chosen, (x, _, z) = _middle(mesh, across)
        terms = np.stack([np.ones_like(x), x, z, x * z], axis=1)
        scale = terms.max(axis=0)
        slopes = np.linalg.lstsq(terms / scale, found.displacement[chosen, 0], rcond=None)[0] / scale
        moment = 0.5 * (found.reactions["right"][4] - found.reactions["left"][4])
        return float(moment / (YOUNG * SIDE**4 / 12.0 * slopes[3]))

    return Problem(mesh=mesh, poisson=poisson, held=_turned_ends(mesh, (0.0, -TURN, 0.0)), measure=measure)


def pad(across: int) -> Problem:
    """Press a pad that is bonded to two plates: its stiffness."""
    mesh = bar([WIDTH * SIDE, WIDTH * SIDE, SIDE], [WIDTH * across, WIDTH * across, across])
    height = mesh.vertices[:, 2]
    held = {
        "low": Held(vertices=_ids(np.isclose(height, height.min()))),
        "high": Held(
            vertices=_ids(np.isclose(height, height.max())), pose=Pose(translation=(0.0, 0.0, -PRESSED * SIDE))
        ),
    }

    def measure(found: Found) -> float:
        return float(-found.reactions["high"][2] / (PAD * YOUNG * PRESSED * (WIDTH * SIDE) ** 2))

    return Problem(mesh=mesh, poisson=CONFINED, held=held, measure=measure)


def tube(across: int) -> Problem:
    """Inflate a short tube with open, free ends, for which Lame's solution is exact: growth of the inner radius."""
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
    # A facet's two corners have half of its force each: along their own radius that is the chord's sine.
    size = PRESSURE * inner * np.sin(2.0 * np.pi / around) * 0.5 * SIDE / across
    growth = PRESSURE / YOUNG * inner**2 / (outer**2 - inner**2)
    exact = growth * ((1.0 - CONFINED) * inner + (1.0 + CONFINED) * outer**2 / inner)

    def measure(found: Found) -> float:
        return float(np.mean(np.sum(found.displacement * outward, axis=1)[wall]) / exact)

    return Problem(
        mesh=mesh,
        poisson=CONFINED,
        held=_three_points(mesh, outer),
        measure=measure,
        forces=size * outward * wall[:, None],
    )


PROBLEMS: dict[str, Callable[[int], Problem]] = {
    "torsion": torsion,
    "torsion 2:1": lambda across: torsion(across, 2),
    "bending": bending,
    "bending, nu 0.495": lambda across: bending(across, CONFINED),
    "pad": pad,
    "tube": tube,
}
"""By name."""


def _bar(across: int, width: int = 1) -> HexMesh:
    length = SLENDERNESS * width
    return bar([length * SIDE, width * SIDE, SIDE], [length * across, width * across, across])


def _ids(chosen: Array) -> np.ndarray:
    return np.flatnonzero(chosen).astype(np.int32)


def _turned_ends(mesh: HexMesh, turn: tuple[float, float, float]) -> dict[str, Held]:
    x = mesh.vertices[:, 0]
    ends = {"left": np.isclose(x, x.min()), "right": np.isclose(x, x.max())}
    return {
        name: Held(vertices=_ids(end), pose=Pose(rotation=tuple(sign * part for part in turn)))
        for (name, end), sign in zip(ends.items(), (1.0, -1.0), strict=True)
    }


def _middle(mesh: HexMesh, across: int) -> tuple[Array, Array]:
    """Mark the vertices in the middle of the bar; return their places (3, k) from the bar's axis as well."""
    places = mesh.vertices - mesh.bounds.mean(axis=0)
    half = np.abs(places[:, 0]).max()
    chosen = np.abs(places[:, 0]) < MIDDLE * half + 0.6 * SIDE / across
    return chosen, places[chosen].T


def _three_points(mesh: HexMesh, radius: float) -> dict[str, Held]:
    """Hold a tube by three of its vertices, so that it can neither move nor turn but strain as it likes."""
    low = mesh.vertices[:, 2].min()
    places = {"east": (radius, 0.0, low), "west": (-radius, 0.0, low), "north": (0.0, radius, low)}
    free = {"east": (), "west": (Axis.X,), "north": (Axis.X, Axis.Y)}
    distance = {name: np.linalg.norm(mesh.vertices - place, axis=1) for name, place in places.items()}
    return {name: Held(vertices=_ids(found < 1e-9), free=free[name]) for name, found in distance.items()}

# SPDX-License-Identifier: Apache-2.0
"""Contact with one obstacle, as a term."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.obstacle import ContactPoints, Obstacle
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact import law
from gdfe_ros.solver.contact.law import ANCHOR, HEAD, NORMAL, OFFSET, PRESS, SHEAR, STRIDE, VERTICES
from gdfe_ros.solver.contact.surface import SHAPE, Surface
from gdfe_ros.solver.contact.touch import Touch
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.state import State
from gdfe_ros.solver.terms.term import Saved, Term

PENALTY = 1.0
"""Penalty at a vertex over the constant matrix' own diagonal there: enough for a few updates, and the matrix still
preconditions the descent."""
FORCE = 1e-2
"""Tolerance over the relative error of contact forces: 1 % at a tolerance of 1e-4."""
REACH = 0.05
"""Distance, over the body's size, beyond which a vertex is left out until the body has moved as far."""


class Contact(Term):
    """Contact of a body's surface with an obstacle.

    Args:
        obstacle: as the scene states it.
        body: the discretised body.
        surface: of the body.
    """

    kernel = law.contact_entry

    def __init__(self, obstacle: Obstacle, body: Body, surface: Surface) -> None:
        self._obstacle, self._body, self._surface = obstacle, body, surface
        count = len(surface.vertices)
        reals, integers = np.zeros(HEAD + STRIDE * count), np.zeros(VERTICES + count, dtype=np.int32)
        reals[law.NUMBERS : law.FRICTION], reals[law.FRICTION] = obstacle.form.numbers, obstacle.friction
        integers[law.KIND] = obstacle.form.kind
        super().__init__(obstacle.name, reals, integers)
        self._penalty, self._distances, self._normals = np.zeros(count), np.zeros(count), np.zeros((count, 3))
        self._chosen, self._faces = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        self.resolution = np.inf
        self.aim({obstacle.name: Pose()})

    @property
    def updates(self) -> bool:
        """Whether any vertex is near the obstacle."""
        return len(self._chosen) > 0

    def fit(self, matrix: ConstantMatrix) -> None:
        """Take penalties from the constant matrix' diagonal."""
        self._penalty = PENALTY * matrix.assembled.diagonal()[self._surface.vertices]

    def couplings(self) -> NDArray[np.int32]:
        """Return the vertices of the surface, each alone."""
        return self._surface.vertices[:, None]

    def tangents(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the penalties that act at ``positions`` (n, 3) [m], without the obstacle's curvature (k, 3, 3)."""
        tangents = np.zeros((len(self._penalty), 3, 3))
        chosen = np.zeros((len(self._chosen), 3, 3))
        law.contact_tangents(positions, self.reals, self.integers, chosen)
        tangents[self._chosen] = chosen
        return tangents

    def neutral(self) -> Saved:
        """Return that nothing touches; anchors are where vertices are when the first solve begins."""
        count = len(self._penalty)
        forces = {"press": np.zeros(count), "shear": np.zeros((count, 3))}
        return {**forces, "anchor": np.full((count, 3), np.nan), "slips": np.ones(count), "lost": np.zeros(1)}

    def aim(self, poses: Mapping[str, Pose]) -> None:
        """Move the obstacle to its pose."""
        self._origin, self._axes = self._obstacle.frame(poses[self.name])
        self.reals[law.AXES : law.ORIGIN] = self._axes.ravel()
        self.reals[law.ORIGIN : law.NUMBERS] = self._origin

    def begin(self, commands: Mapping[str, float], saved: Saved, positions: NDArray[np.float64], ratio: float) -> None:
        """Take the multipliers of the last step, turned on with the obstacle."""
        self._choose(saved, positions)

    def update(self, positions: NDArray[np.float64]) -> float:
        """Update the multipliers; a relative change of the forces counts as `FORCE` times as much of the size."""
        miss, change, forces, penalties = law.update_multipliers(positions, self.reals, self.integers)
        self.resolution = FORCE * forces / penalties if forces > 0.0 else np.inf
        relative = change / forces if forces > 0.0 else 0.0
        return max(miss, FORCE * self._body.size * relative, self._correct(positions))

    def reached(self, positions: NDArray[np.float64]) -> bool:
        """Tell whether vertices that were left out may touch by now, and take them in."""
        moved = positions - self._seen
        if not np.einsum("ni,ni->n", moved, moved).max() > (REACH * self._body.size) ** 2:
            return False
        before = len(self._chosen)
        rows = self._rows()
        self._choose({**self._saved, **self._spread(rows[:, PRESS], rows[:, SHEAR : SHEAR + 3])}, positions)
        return len(self._chosen) > before

    def finish(self, saved: Saved, positions: NDArray[np.float64]) -> Saved:
        """Keep forces, and anchors of the vertices that stick; all others have theirs where they are.

        ``lost`` is what friction has turned to heat so far [J].
        """
        _, presses, shears, slips = self._forces(positions)
        slips |= ~(presses > 0.0)
        places, rows = positions[self._surface.vertices], self._rows()
        anchors, anchor = rows[:, ANCHOR : ANCHOR + 3], (places - self._origin) @ self._axes
        anchor[self._chosen[~slips]] = (anchors[~slips] - self._origin) @ self._axes
        rubbed = -np.einsum("ki,ki->", shears[slips], (places[self._chosen] - anchors)[slips])
        slipping = np.ones(len(places))
        slipping[self._chosen] = slips
        kept = {"anchor": anchor, "slips": slipping, "lost": saved["lost"] + rubbed}
        return {**self._spread(presses, -shears), **kept}

    def energy(self, positions: NDArray[np.float64]) -> float:
        """Return nothing: an obstacle stores nothing."""
        return 0.0

    def wrench(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return force [N] and moment [N m] about the obstacle's origin (6,) that it exerts on the body."""
        forces = self._forces(positions)[0]
        arms = positions[self._surface.vertices[self._chosen]] - self._origin
        return np.concatenate([forces.sum(axis=0), np.cross(arms, forces).sum(axis=0)])

    def touch(self, state: State, origin: NDArray[np.float64]) -> Touch:
        """Return what touches the obstacle in a state whose positions are counted from ``origin`` (3,) [m]."""
        saved, (middle, axes) = state.terms[self.name], self._obstacle.frame(state.poses[self.name])
        on = np.flatnonzero(saved["press"] > 0.0)
        vertices, gaps, normals = self._surface.vertices[on], np.empty(len(on)), np.empty((len(on), 3))
        head = np.concatenate([axes.ravel(), middle, self._obstacle.form.numbers])
        law.distances(state.positions, vertices, head, self.integers[law.KIND], gaps, normals)
        return Touch(
            vertices=vertices,
            places=state.positions[vertices] + origin,
            normals=normals,
            gaps=gaps,
            presses=saved["press"][on],
            shears=-saved["shear"][on] @ axes.T,
            slips=saved["slips"][on] > 0.0,
        )

    def _choose(self, saved: Saved, positions: NDArray[np.float64]) -> None:
        """Take in the vertices that are near at ``positions`` (n, 3) [m] or touched at the end of the last step."""
        surface, kind = self._surface, self.integers[law.KIND]
        law.distances(positions, surface.vertices, self.reals, kind, self._distances, self._normals)
        self._saved, self._seen = saved, positions
        near = (self._distances < REACH * self._body.size) | (saved["press"] > 0.0)
        chosen = self._chosen = np.flatnonzero(near)
        vertices = surface.vertices[chosen]
        self.integers[law.COUNT] = len(chosen)
        self.integers[VERTICES : VERTICES + len(chosen)] = vertices
        rows = self._rows()
        rows[:, law.PENALTY], rows[:, PRESS] = self._penalty[chosen], saved["press"][chosen]
        rows[:, SHEAR : SHEAR + 3] = saved["shear"][chosen] @ self._axes.T
        anchors = saved["anchor"][chosen] @ self._axes.T + self._origin
        rows[:, ANCHOR : ANCHOR + 3] = np.where(np.isnan(anchors), positions[vertices], anchors)
        self._faces = surface.about(vertices) if len(vertices) else np.zeros(0, dtype=np.int64)
        rows[:, NORMAL : NORMAL + 3] = self._normals[chosen]
        self._correct(positions)

    def _correct(self, positions: NDArray[np.float64]) -> float:
        """Take by how much faces are nearer than their corners; return by how much [m] that changed."""
        if not len(self._faces) or self._obstacle.points is ContactPoints.VERTICES:
            return 0.0
        surface, faces = self._surface, self._faces
        nearer = np.zeros(len(positions))
        kind = self.integers[law.KIND]
        law.nearness(positions, surface.quads[faces], surface.gauss[faces], SHAPE, self.reals, kind, nearer)
        chosen, rows = self._chosen, self._rows()
        offsets = np.maximum(0.0, nearer[surface.vertices[chosen]] / surface.areas[chosen])
        change = np.abs(offsets - rows[:, OFFSET]).max(initial=0.0)
        rows[:, OFFSET] = offsets
        return float(change)

    def _forces(self, positions: NDArray[np.float64]) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """Return forces (k, 3), presses (k,), shears (k, 3) [N] of the chosen vertices, and which slip (k,)."""
        count = len(self._chosen)
        forces, shears = np.zeros((count, 3)), np.zeros((count, 3))
        presses, slips = np.zeros(count), np.zeros(count, dtype=np.bool_)
        law.contact_forces(positions, self.reals, self.integers, forces, presses, shears, slips)
        return forces, presses, shears, slips

    def _spread(self, presses: NDArray[np.float64], shears: NDArray[np.float64]) -> Saved:
        """Return forces on the chosen vertices (k,), (k, 3) [N] as those on all, shears in the obstacle's axes."""
        press, shear = np.zeros(len(self._penalty)), np.zeros((len(self._penalty), 3))
        press[self._chosen], shear[self._chosen] = presses, shears @ self._axes
        return {"press": press, "shear": shear}

    def _rows(self) -> NDArray[np.float64]:
        return self.reals[HEAD : HEAD + STRIDE * len(self._chosen)].reshape(-1, STRIDE)


def contacts_of(body: Body) -> list[Contact]:
    """Return the contacts of a body with its obstacles."""
    obstacles = [handle for handle in body.handles if isinstance(handle, Obstacle)]
    surface = Surface.of(body) if obstacles else None
    return [Contact(obstacle, body, surface) for obstacle in obstacles]

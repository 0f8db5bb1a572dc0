# SPDX-License-Identifier: Apache-2.0
"""Term of the potential for self-contact: pairs of vertices and faces, and of edges that cross."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.obstacle import NAME, SelfContact
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact import held_pairs as pair
from gdfe_ros.solver.contact.contact_term import MARGIN, ContactTerm, Stencils
from gdfe_ros.solver.contact.crossing import LEAST, SEATS
from gdfe_ros.solver.contact.inside import Inside
from gdfe_ros.solver.contact.own_pairs import OwnPairs
from gdfe_ros.solver.contact.own_points import OwnPoints
from gdfe_ros.solver.contact.own_surface import Nearest
from gdfe_ros.solver.contact.pair_touch import frames, tangential, touching_points
from gdfe_ros.solver.contact.touch import NOTHING, Touch
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.state import Saved, State

REACH, FARTHEST = 0.02, 0.25
"""The search distance for faces is the first number times the body's size, plus twice the step's largest displacement
relative to the surface's mean displacement. The second number times the body's size limits this sum.
"""
DEEPEST = 1e-4
"""Largest penetration depth, divided by the body's size, at the end of a step."""
CLEAR = 1.5
"""Least search distance, divided by the largest penetration depth in the last accepted state, or at the last search."""
VALID = 2.0
"""Relative displacement of a pair for which its plane holds, divided by `Topology.depth`."""
SAME_SIDE = 0.5
"""A vertex keeps its forces if the cosine between its old and its new contact normal exceeds this."""


class OwnContact(ContactTerm):
    """Contact of the parts of a mesh with each other, and of each part with itself.

    During an iteration of the minimisation each vertex keeps its face and the plane of that face, and each sharp edge
    keeps the edge that it crosses and the plane along both. Before each iteration, faces, edges and planes are searched
    anew. The first search uses the positions of the last accepted state.

    Args:
        meant: the self-contact definition: faces that may touch, and friction.
        body: the discretised body.
    """

    kernel, potential = pair.pair_entry, staticmethod(pair.pair_energy)
    _FRICTION, _HEAD, _STRIDE, _PRESS = pair.FRICTION, pair.HEAD, pair.STRIDE, pair.PRESS

    def __init__(self, meant: SelfContact, body: Body) -> None:
        self.points = OwnPoints.of(body)
        self.pairs = OwnPairs(body, self.points, meant)
        self.surface = self.pairs.surface
        self.penetration = Inside(body, self.points, self.surface.topology, meant)
        count, vertices = self.pairs.count, len(self.surface.topology.vertices)
        reals = np.concatenate([np.zeros(pair.HEAD + pair.STRIDE * count), self.points.weights.ravel()])
        ends = np.zeros(pair.VERTICES + pair.WIDTH * count, dtype=np.int32)
        ends[pair.BODY], ends[pair.CARRIERS] = len(body.rest), len(ends)
        reals[pair.FRICTION], ends[pair.CARRIED] = meant.friction, pair.HEAD + pair.STRIDE * count
        super().__init__(NAME, body, reals, np.concatenate([ends, self.points.corners.ravel()]))
        self.restitution = meant.restitution
        self._yielding, self.valid = np.zeros(0), VALID * self.surface.topology.depth
        self._begins, self._clear, self._clearance = False, False, 0.0
        self._aside = MARGIN * body.size + self.surface.topology.rim  # pairs that stay farther apart take no part
        self._last: State | None = None
        self._reach, self._sunk = 0.0, np.zeros(vertices, dtype=np.bool_)
        none = np.zeros((count, 3))
        self._free = {
            "press": np.zeros(count), "shear": none, "push": np.zeros(count), "rub": none, "normal": none,
            "slips": np.ones(count), "face": np.full(count, -1.0), "weights": np.zeros((count, 4)),
        }  # fmt: skip

    @property
    def scale(self) -> NDArray[np.float64]:
        """Stiffnesses (k,) [N/m] of the body at the pairs."""
        return self._rows()[:, pair.SCALE]

    def ends(self) -> NDArray[np.int32]:
        """Return the vertices (k, 1) on which the forces of pairs can act."""
        vertices = self.surface.topology.vertices
        carriers = self.points.corners[vertices[vertices >= self.points.count] - self.points.count]
        return np.unique(np.concatenate([vertices[vertices < self.points.count], carriers.ravel()]))[:, None]

    def fit(self, matrix: ConstantMatrix) -> None:
        """Set the points' compliances from the constant matrix' diagonal; vertices that handles drive have none."""
        self._yielding = self.points.yielding(self._body, matrix.assembled.diagonal())

    def neutral(self) -> Saved:
        """Return the stored state without contact: no forces, no faces, no dissipated energy."""
        return {**self._free, "lost": np.zeros(1)}

    def aim(self, poses: Mapping[str, Pose], last: State) -> None:
        """Set the state from which pairs are searched: the anchor of ``last`` if it has one, else ``last`` itself."""
        self._last = last if last is None else last.anchor or last

    def begin(self, commands: Mapping[str, float], saved: Saved, positions: NDArray[np.float64], ratio: float) -> None:
        """Search the pairs. Start from the forces of the last step, rotated with their faces."""
        x = self.points.at(positions)
        last = x if self._last is None else self.points.at(self._last.positions)
        self._from = self._seen = last
        far = self.pairs.motion(x, last)
        self._begins = far > self.surface.topology.depth
        self._find_sunk()
        self._set_reach(x, 0.0)
        found = self.pairs.look(last, last, self._reach, saved["face"].astype(np.int64), self._sunk)
        some, every = saved["face"] >= 0.0, np.arange(self.pairs.count)
        axes = frames(x, self.pairs.carriers(every[some], saved["face"][some].astype(np.int64)))
        self._press, self._shear, self._normal = saved["press"].copy(), saved["shear"].copy(), saved["normal"]
        self._shear[some] = np.einsum("kij,kj->ki", axes, saved["shear"][some])
        on = found.face >= 0
        before, after = (frames(at, self.pairs.carriers(every[on], found.face[on])) for at in (last, x))
        found.normal[on] = np.einsum("kij,klj,kl->ki", after, before, found.normal[on])
        self._pack(found, x)
        self._deepest = 2.0 * far
        self._measure_clearance(last)

    @property
    def near(self) -> bool:
        """Whether any pair may touch in the next step of the minimisation."""
        return super().near and not self._clear

    def follow(self, positions: NDArray[np.float64], ahead: float) -> None:
        """Search the pairs again at ``positions`` (n, 3) [m]; pairs that persist keep their forces.

        Nothing is searched if the next displacement of at most ``ahead`` [m] leaves everything apart. After a large
        displacement, the pairs of the last state serve for one iteration: it moves entered vertices back.
        """
        x = self.points.at(positions)
        apart = self._clearance - self._aside
        self._clear = not self.acts and 2.0 * (self.pairs.motion(x, self._cleared) + ahead) < apart
        if self._clear:
            return
        if self._begins:
            self._begins = False
            return
        rows, chosen = self._rows(), self._chosen
        self._press[chosen], self._shear[chosen] = rows[:, pair.PRESS], rows[:, pair.SHEAR : pair.OFFSET]
        self._set_reach(x, self._deepest)
        found = self.pairs.look(x, self._from, self._reach, self._partners, self._sunk)
        before, pressed = self._partners, self._press > 0.0
        self._pack(found, x)
        self.changed = bool((pressed & ((found.face != before) | (self._press == 0.0))).any())
        if not pressed.any():
            self._measure_clearance(x)

    def stencils(self, positions: NDArray[np.float64]) -> Stencils:
        """Return what the complementarity problem needs of the pairs at ``positions`` (n, 3) [m]."""
        found = Stencils.empty(self.count, pair.WIDTH * (8 if len(self.points.corners) else 1))
        pair.pair_stencils(positions, self.reals, self.integers, *found)
        return found

    def hold_forces(self, axes: NDArray[np.float64], forces: NDArray[np.float64]) -> None:
        """Set the forces (k, 3) [N] of the pairs along ``axes`` (k, 3, 3)."""
        rows = self._rows()
        rows[:, pair.PRESS] = forces[:, 0]
        rows[:, pair.SHEAR : pair.OFFSET] = -np.einsum("ka,kai->ki", forces[:, 1:], axes[:, 1:])

    def finish(self, saved: Saved, positions: NDArray[np.float64]) -> Saved:
        """Return the state to store: the pairs, and their forces.

        The entry ``lost`` is the energy dissipated by friction so far [J].
        """
        if not self._rows()[:, pair.PRESS].any():
            return {**self._free, "lost": saved["lost"]}
        chosen, rows, kept = self._chosen, self._rows(), {name: array.copy() for name, array in self._free.items()}
        presses, shears, slips, _ = self._forces(positions)
        slips |= ~(presses > 0.0)
        axes = frames(self.points.at(positions), self.pairs.carriers(chosen, self._face))
        kept["press"][chosen], kept["slips"][chosen] = presses, slips
        kept["shear"][chosen] = np.einsum("kji,kj->ki", axes, shears)
        kept["normal"][chosen] = rows[:, pair.NORMAL : pair.NORMAL + 3]
        kept["face"][chosen], kept["weights"][chosen] = self._face, self._weights
        return self.exerted(saved, kept, positions, presses, -shears)

    def exerted(
        self,
        saved: Saved,
        kept: Saved,
        positions: NDArray[np.float64],
        pushes: NDArray[np.float64],
        shears: NDArray[np.float64],
    ) -> Saved:
        """Do what `Contact.exerted` does, for pairs."""
        chosen, slips, slid = self._chosen, kept["slips"][self._chosen] > 0.0, self._forces(positions)[3]
        axes = frames(self.points.at(positions), self.pairs.carriers(chosen, self._face))
        push, rub = self._free["press"].copy(), self._free["shear"].copy()
        push[chosen], rub[chosen] = pushes, np.einsum("kji,kj->ki", axes, shears)
        lost = saved["lost"] - np.einsum("ki,ki->", shears[slips], slid[slips])
        return {**kept, "push": push, "rub": rub, "lost": lost}

    def touch(self, state: State, origin: NDArray[np.float64]) -> Touch:
        """Return the forces on both sides of all pairs; positions of ``state`` are relative to ``origin`` (3,) [m]."""
        saved = state.terms[self.name]
        on = np.flatnonzero(saved["push"])
        if not len(on):
            return NOTHING
        x, quads = self.points.at(state.positions), self.pairs.carriers(on, saved["face"][on].astype(np.int64))
        shears = np.einsum("kij,kj->ki", frames(x, quads), saved["rub"][on])
        found = touching_points(
            x,
            origin,
            self.pairs.first[on],
            quads,
            weights=saved["weights"][on],
            normals=saved["normal"][on],
            presses=saved["push"][on],
            shears=shears,
            slips=saved["slips"][on] > 0.0,
        )
        if not len(self.points.corners):
            return found
        main, numbers = self.points.main, self.points.numbers
        return replace(found, vertices=main[found.vertices], others=main[found.others], points=numbers[found.vertices])

    def flaw(self, positions: NDArray[np.float64]) -> str:
        """Return a sentence about the deepest penetration, or an empty string if its depth is within `DEEPEST`.

        Every surface vertex is checked, also a vertex without a pair in the solve, and every crossing of edges, also of
        two edges that have passed each other since the last state.
        """
        bound, x = DEEPEST * self._body.size, self.points.at(positions)
        depth, text = self.penetration.told(x, bound)
        reach = REACH * self._body.size + 2.0 * self.pairs.motion(x, self._from)
        crossed = self.pairs.cross(x, self._from, reach, self._partners)
        deepest = int(crossed.gap.argmin()) if len(crossed.gap) else -1
        if deepest >= 0 and -crossed.gap[deepest] > max(depth, bound):
            ends = self.pairs.edges.topology.ends[[deepest // SEATS, crossed.face[deepest]]]
            text = self.penetration.told_of(x, ends, -float(crossed.gap[deepest]))
        return text

    def _measure_clearance(self, x: NDArray[np.float64]) -> None:
        """Find the least distance at the points ``x`` (n + p, 3) [m] of what can touch."""
        self._clear, self._cleared, self._clearance = False, x, self.pairs.clearance(x, self._reach)

    def _set_reach(self, x: NDArray[np.float64], deepest: float) -> None:
        """Set the search distance at the points ``x`` (n + p, 3) [m]; some may have been ``deepest`` [m] inside."""
        size = self._body.size
        reach = min(REACH * size + 2.0 * self.pairs.motion(x, self._seen), FARTHEST * size)
        self._reach, self._seen = max(reach, CLEAR * max(deepest, self._least)), x

    def _find_sunk(self) -> None:
        """Mark the vertices that penetrated in the last state: contact pushes them out through their nearest face."""
        self._sunk, self._least = np.zeros(len(self.surface.topology.vertices), dtype=np.bool_), 0.0
        if self._last is None or self._last.summary.converged:
            return
        depths = self.penetration.depths(self._from, DEEPEST * self._body.size)[0]
        self._sunk, self._least = depths > 0.0, float(depths.max())

    def _before(
        self, pairs: NDArray[np.int64], face: NDArray[np.int64], weights: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the vectors (k, 3) [m] from the second member of each pair to the first, in the last state.

        ``weights`` (k, 4) are those of the corners. The vectors do not turn with the faces. All slips are then
        projections of one displacement field, so that vertex on vertex, each in the other's pair, do not contradict.
        """
        return self._from[self.pairs.first[pairs]] - np.einsum(
            "ka,kai->ki", weights, self._from[self.pairs.carriers(pairs, face)]
        )

    def _pack(self, found: Nearest, x: NDArray[np.float64]) -> None:
        """Write the pairs found at the points ``x`` (n + p, 3) [m] to the kernels' arrays.

        Persisting pairs keep their forces.
        """
        near = np.flatnonzero((found.face >= 0) & (found.support >= LEAST))
        corners = self.pairs.carriers(near, found.face[near])
        give = self.pairs.give(self._yielding, near, corners, found.weights[near])
        yields = give > 0.0
        chosen, corners, give = near[yields], corners[yields], give[yields]
        lost = np.einsum("ki,ki->k", self._normal, found.normal) < SAME_SIDE
        kept = np.zeros(self.pairs.count, dtype=np.bool_)
        kept[chosen] = ~lost[chosen]
        self._press[~kept], self._shear[~kept] = 0.0, 0.0
        self._normal, self._partners = found.normal, found.face
        self._deepest = -float(found.gap.min(initial=0.0))
        normal = found.normal[chosen]
        shear = tangential(self._shear[chosen], normal)
        self._chosen, self._face, self._weights = chosen, found.face[chosen], found.weights[chosen]
        self.integers[pair.COUNT] = len(chosen)
        rows = self._rows()
        rows[:, pair.SCALE], rows[:, pair.PRESS] = 1.0 / give, self._press[chosen]
        rows[:, pair.NORMAL : pair.WEIGHTS], rows[:, pair.WEIGHTS : pair.SHEAR] = normal, self._weights
        before = self._before(chosen, self._face, self._weights)
        rows[:, pair.SHEAR : pair.OFFSET], rows[:, pair.OFFSET : pair.SUPPORT] = shear, tangential(before, normal)
        rows[:, pair.SUPPORT] = found.support[chosen]
        ends = self.integers[pair.VERTICES : pair.VERTICES + pair.WIDTH * len(chosen)].reshape(-1, pair.WIDTH)
        ends[:, pair.VERTEX], ends[:, pair.FACE :] = self.pairs.first[chosen], corners

    def _forces(self, positions: NDArray[np.float64]) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """Return normal (k,) and friction forces (k, 3) [N], slip flags (k,) and slips (k, 3) [m]."""
        count = len(self._chosen)
        presses, slips = np.zeros(count), np.zeros(count, dtype=np.bool_)
        shears, slid = np.zeros((count, 3)), np.zeros((count, 3))
        pair.pair_forces(positions, self.reals, self.integers, presses, shears, slips, slid)
        return presses, shears, slips, slid

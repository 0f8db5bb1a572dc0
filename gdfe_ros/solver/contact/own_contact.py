# SPDX-License-Identifier: Apache-2.0
"""Term of the potential for self-contact: pairs of vertices and faces, and of edges that cross."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.self_contact import NAME, SelfContact
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact import pair_law as law
from gdfe_ros.solver.contact.contact_term import ContactTerm
from gdfe_ros.solver.contact.crossing import SEATS
from gdfe_ros.solver.contact.inside import Inside
from gdfe_ros.solver.contact.own_pairs import OwnPairs
from gdfe_ros.solver.contact.own_points import OwnPoints
from gdfe_ros.solver.contact.own_surface import Nearest
from gdfe_ros.solver.contact.pair_touch import across, frames, tangential, touching_points
from gdfe_ros.solver.contact.settling import Settling, parted
from gdfe_ros.solver.contact.touch import NOTHING, Touch
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.state import Saved, State
from gdfe_ros.solver.tangent.springs import Springs

REACH, FARTHEST = 0.02, 0.25
"""The search distance for faces is the first number times the body's size, plus twice the step's largest displacement
relative to the surface's mean displacement. The second number times the body's size limits this sum.
"""
ROUNDING = 1e-9
"""A pair counts as slipping if its friction force is below the limit by less than this fraction."""
DEEPEST = 1e-4
"""Largest penetration depth, divided by the body's size, at the end of a converged step."""
BURIED = 1e-3
"""Largest penetration depth, divided by the body's size, with which a step is accepted, even if not converged."""
CLEAR = 1.5
"""Least search distance, divided by the largest penetration depth in the last accepted state."""
SAME_SIDE = 0.5
"""A vertex keeps its multipliers if the cosine between its old and its new contact normal exceeds this."""


class OwnContact(ContactTerm):
    """Contact of the parts of a mesh with each other, and of each part with itself.

    During a minimisation each vertex keeps its face and the plane of that face, and each sharp edge keeps the edge that
    it crosses and the plane along both. Between minimisations, new faces, edges and planes are searched. The first
    search uses the positions of the last accepted state.

    Args:
        meant: the self-contact definition: faces that may touch, and friction.
        body: the discretised body.
    """

    kernel, potential = law.pair_entry, staticmethod(law.pair_energy)

    def __init__(self, meant: SelfContact, body: Body) -> None:
        self.points = OwnPoints.of(body)
        self.pairs = OwnPairs(body, self.points, meant)
        self.surface = self.pairs.surface
        self.penetration = Inside(body, self.points, self.surface.topology, meant)
        count, vertices = self.pairs.count, len(self.surface.topology.vertices)
        reals = np.concatenate([np.zeros(law.HEAD + law.STRIDE * count), self.points.weights.ravel()])
        ends = np.zeros(law.VERTICES + law.WIDTH * count, dtype=np.int32)
        ends[law.BODY], ends[law.CARRIERS] = len(body.rest), len(ends)
        reals[law.FRICTION], ends[law.CARRIED] = meant.friction, law.HEAD + law.STRIDE * count
        super().__init__(NAME, body, reals, np.concatenate([ends, self.points.corners.ravel()]))
        self._yielding = np.zeros(0)
        self._chosen, self._on = np.zeros(0, dtype=np.int64), False
        self._last: State | None = None
        self._reach, self._sunk = 0.0, np.zeros(vertices, dtype=np.bool_)
        none = np.zeros((count, 3))
        self._free = {
            "press": np.zeros(count), "shear": none, "normal": none, "slips": np.ones(count),
            "face": np.full(count, -1.0), "weights": np.zeros((count, 4)), "offset": none,
        }  # fmt: skip

    @property
    def updates(self) -> bool:
        """Whether any pair touches."""
        return self._on

    def fit(self, matrix: ConstantMatrix) -> None:
        """Set the points' compliances from the constant matrix' diagonal; vertices that handles drive have none."""
        self._yielding = self.points.yielding(self._body, matrix.assembled.diagonal())

    def springs(self, positions: NDArray[np.float64]) -> Springs:
        """Return the penalties as springs: one normal to each pressing pair, two tangential to each sticking pair."""
        rows, chosen = self._rows(), self._chosen
        _, presses, _, slips, _ = self._forces(positions)
        penalty, normals = rows[:, law.PENALTY], rows[:, law.NORMAL : law.WEIGHTS]
        press, stick = presses > 0.0, (self.reals[law.FRICTION] * rows[:, law.PRESS] > 0.0) & ~slips
        corners, held = self.pairs.carriers(chosen, self._face), self.pairs.carriers(chosen, self._hold[chosen])
        parts = [(press, corners, self._weights, normals, penalty * rows[:, law.SUPPORT])]
        parts += [(stick, held, self._hold_weights[chosen], way, penalty) for way in across(normals)]
        ends = [np.column_stack([self.pairs.first[chosen], quads])[on] for on, quads, *_ in parts]
        ways = [
            (np.sqrt(stiffness)[:, None, None] * np.insert(-weights, 0, 1.0, axis=1)[:, :, None] * way[:, None, :])[on]
            for on, _, weights, way, stiffness in parts
        ]
        return Springs.between(*self.points.carried(np.concatenate(ends), np.concatenate(ways)))

    def neutral(self) -> Saved:
        """Return the stored state without contact: no forces, no faces, no dissipated energy."""
        return {**self._free, "lost": np.zeros(1)}

    def aim(self, poses: Mapping[str, Pose], last: State) -> None:
        """Set the state from which pairs are searched: the anchor of ``last`` if it has one, else ``last`` itself."""
        self._last = last if last is None else last.anchor or last

    def begin(self, commands: Mapping[str, float], saved: Saved, positions: NDArray[np.float64], ratio: float) -> None:
        """Search the pairs. Start from the multipliers of the last step, rotated with their faces."""
        self._settling, self._scale = Settling(positions, held=self.reals[law.FRICTION] > 0.0), 0.0
        x = self.points.at(positions)
        last = x if self._last is None else self.points.at(self._last.positions)
        self._from, size = last, self._body.size
        moved = x - last
        far = float(np.abs(moved - moved[self.surface.topology.vertices].mean(axis=0)).max(initial=0.0))
        self._reach = min(REACH * size + 2.0 * far, FARTHEST * size)
        self.missed, entered = 0.0, self._entered(x)
        found = self.pairs.look(last, last, self._reach, saved["face"].astype(np.int64), self._sunk)
        self.hopeless = self.gives_up and bool(((entered > 0.0) & (found.face[: len(entered)] < 0)).any())
        kept = saved["slips"] == 0.0
        face = np.where(kept, saved["face"], found.face).astype(np.int64)
        some, every = saved["face"] >= 0.0, np.arange(self.pairs.count)
        axes = frames(x, self.pairs.carriers(every[some], saved["face"][some].astype(np.int64)))
        self._press, self._shear, self._normal = saved["press"].copy(), saved["shear"].copy(), saved["normal"]
        self._shear[some] = np.einsum("kij,kj->ki", axes, saved["shear"][some])
        self._hold, self._hold_weights = face, np.where(kept[:, None], saved["weights"], found.weights)
        self._offset = tangential(self._away(last, every, face, self._hold_weights), found.normal)
        self._offset[kept] = np.einsum("kij,kj->ki", axes[kept[some]], saved["offset"][kept])
        self._began = self._hold.copy(), self._hold_weights.copy(), self._offset.copy()
        on = found.face >= 0
        before, after = (frames(at, self.pairs.carriers(every[on], found.face[on])) for at in (last, x))
        found.normal[on] = np.einsum("kij,klj,kl->ki", after, before, found.normal[on])
        self._pack(found, last)
        self._on, rows = bool(self._press.any()), self._rows()
        self._expect(rows[:, law.PRESS], rows[:, law.PENALTY])

    def update(self, positions: NDArray[np.float64]) -> float:
        """Update the multipliers, search the nearest faces again, and return the error of the last multipliers [m]."""
        rows, chosen = self._rows(), self._chosen
        self._scale = self._scale or float(rows[:, law.PRESS].sum()) / max(1, len(rows))
        self._held = self._multipliers()
        miss, change, forces, penalties = law.update_pairs(positions, self.reals, self.integers)
        gaps = self._forces(positions)[0]
        press = rows[:, law.PRESS].copy()
        pushed, given_up = press > 0.0, press / rows[:, law.PENALTY]
        self._press[chosen], self._shear[chosen] = press, rows[:, law.SHEAR : law.SHEAR + 3]
        x = self.points.at(positions)
        found = self.pairs.look(x, self._from, self._reach, self._partners, self._sunk)
        self._follow(found, x)
        self._pack(found, x)
        kept = pushed & (self._press[chosen] > 0.0)
        shifted = np.abs(found.gap[chosen] - gaps)[kept].max(initial=0.0)
        miss = max(miss, float(shifted), float(given_up[pushed & ~kept].max(initial=0.0)))
        chosen, held = self._chosen, self._rows()[:, law.PRESS] / self._rows()[:, law.PENALTY]
        deepest = float((found.support[chosen] * (held - found.gap[chosen]) - held).max(initial=0.0))
        self.missed = max(miss, deepest)
        missed = max(self.missed, self._judge(change, forces, penalties))
        self._settling.way(positions, missed)
        return missed

    def hasten(self, near: float) -> None:
        """Extrapolate multipliers and normals of pressing pairs, or shorten a plain update; see `Settling.mixed`.

        If at most the distance ``near`` [m] remains, plain updates come first. Few updates are needed, and they are
        plain until they swing.
        """
        if not (self._on and self._settling.swings):
            return
        found = self._multipliers()
        mixed = self._settling.mixed(self._held, found, near)
        rows, chosen = self._rows(), self._chosen
        on = (found[chosen, 0] > 0.0) & (mixed[chosen, 0] > 0.0)
        press, shear, normal = parted(mixed[chosen[on]], rows[on, law.NORMAL : law.WEIGHTS], SAME_SIDE)
        rows[on, law.PRESS], rows[on, law.SHEAR : law.HOLD], rows[on, law.NORMAL : law.WEIGHTS] = press, shear, normal

    def reached(self, positions: NDArray[np.float64]) -> bool:
        """Search the pairs again if no pair touched so far; return whether one touches at ``positions`` (n, 3) [m]."""
        if self._on:
            return False
        x = self.points.at(positions)
        found = self.pairs.look(x, self._from, self._reach, self._partners, self._sunk)
        self._pack(found, x)
        self._on = bool((found.gap[self._chosen] < 0.0).any())
        if self._on and self.gives_up:
            self.hopeless = self._entered(x).max() > self.surface.topology.depth
        return self._on

    def finish(self, saved: Saved, positions: NDArray[np.float64]) -> Saved:
        """Return the state to store: pair forces, and the anchors of the sticking pairs.

        The entry ``lost`` is the energy dissipated by friction so far [J].
        """
        if not self._on:
            return {**self._free, "lost": saved["lost"]}
        chosen, rows, kept = self._chosen, self._rows(), {name: array.copy() for name, array in self._free.items()}
        _, presses, shears, slips, slid = self._forces(positions)
        slips |= ~(presses > 0.0)
        face, weights = self._hold[chosen], self._hold_weights[chosen]
        face, weights = np.where(slips, self._face, face), np.where(slips[:, None], self._weights, weights)
        x = self.points.at(positions)
        axes, offset = frames(x, self.pairs.carriers(chosen, face)), self._away(x, chosen, face, weights)
        offset[~slips] = rows[~slips, law.OFFSET : law.SUPPORT]
        offset = tangential(offset, rows[:, law.NORMAL : law.WEIGHTS])
        kept["press"][chosen], kept["slips"][chosen] = presses, slips
        kept["shear"][chosen] = np.einsum("kji,kj->ki", axes, shears)
        kept["offset"][chosen] = np.einsum("kji,kj->ki", axes, offset)
        kept["normal"][chosen] = rows[:, law.NORMAL : law.NORMAL + 3]
        kept["face"][chosen], kept["weights"][chosen] = face, weights
        rubbed = float(np.einsum("ki,ki->", shears[slips], slid[slips]))
        return {**kept, "lost": saved["lost"] + self.share * rubbed, "share": np.array([self.share])}

    def touch(self, state: State, origin: NDArray[np.float64]) -> Touch:
        """Return the forces on both sides of all pairs; positions of ``state`` are relative to ``origin`` (3,) [m]."""
        saved = state.terms[self.name]
        on = np.flatnonzero(saved["press"])
        if not len(on):
            return NOTHING
        x, quads = self.points.at(state.positions), self.pairs.carriers(on, saved["face"][on].astype(np.int64))
        shears = np.einsum("kij,kj->ki", frames(x, quads), saved["shear"][on])
        found = touching_points(
            x,
            origin,
            self.pairs.first[on],
            quads,
            weights=saved["weights"][on],
            normals=saved["normal"][on],
            presses=saved["share"] * saved["press"][on],
            shears=-saved["share"] * shears,
            slips=saved["slips"][on] > 0.0,
        )
        if not len(self.points.corners):
            return found
        main, numbers = self.points.main, self.points.numbers
        return replace(found, vertices=main[found.vertices], others=main[found.others], points=numbers[found.vertices])

    def flaw(self, positions: NDArray[np.float64]) -> str:
        """Return a sentence about the deepest penetration, or an empty string if its depth is within `DEEPEST`.

        Every surface vertex is checked, also a vertex without a pair in the solve, and every crossing of edges, also of
        two edges that have passed each other since the last state. The attribute ``buried`` is set.
        """
        bound, x = DEEPEST * self._body.size, self.points.at(positions)
        depth, text = self.penetration.told(x, bound)
        crossed = self.pairs.edges.look(x, self._from, self._reach, self._partners[len(self._sunk) :])
        deepest = int(crossed.gap.argmin()) if len(crossed.gap) else -1
        if deepest >= 0 and -crossed.gap[deepest] > max(depth, bound):
            depth, other = -float(crossed.gap[deepest]), crossed.face[deepest]
            text = self.penetration.told_of(x, self.pairs.edges.topology.ends[[deepest // SEATS, other]], depth)
        self.buried = depth > BURIED * self._body.size
        return text

    def _entered(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the penetration depths (k,) [m] of the surface's points that were outside in the last accepted state.

        ``x`` (n + p, 3) [m] are the positions of the points. The depth of a point that already penetrated in this state
        is 0. ``_sunk`` marks such a point. Contact pushes it out through its nearest face.
        """
        within = min(REACH * self._body.size, self.surface.topology.depth)
        depths = self.penetration.depths(x, within)[0]
        self._sunk = np.zeros(len(depths), dtype=np.bool_)
        if not depths.any():
            return depths
        before = self.penetration.depths(self._from, DEEPEST * self._body.size)[0]
        self._sunk = before > 0.0
        self._reach = max(self._reach, CLEAR * float(before.max()))
        return np.where(self._sunk, 0.0, depths)

    def _follow(self, found: Nearest, x: NDArray[np.float64]) -> None:
        """Set, for each pair, the face point on which friction acts.

        A slipping pair gets the face point that its vertex touches now; any other pair keeps its face point from the
        start of the solve. The slip is the vertex' motion since the last state relative to this material point.
        Intermediate positions have no effect on it.
        """
        rows, chosen, limit = self._rows(), self._chosen, self.reals[law.FRICTION] * self._rows()[:, law.PRESS]
        shear = np.linalg.norm(rows[:, law.SHEAR : law.HOLD], axis=1)
        on = (limit > 0.0) & (shear > (1.0 - ROUNDING) * limit) & (found.face[chosen] >= 0)
        hold, weights, offset = self._began
        sticks = chosen[~on & (hold[chosen] >= 0)]
        self._hold[sticks], self._hold_weights[sticks] = hold[sticks], weights[sticks]
        self._offset[sticks] = offset[sticks]
        slips = chosen[on]
        self._hold[slips], self._hold_weights[slips] = found.face[slips], found.weights[slips]
        before = self._before(x, slips, found.face[slips], found.weights[slips])
        self._offset[slips] = tangential(before, found.normal[slips])

    def _away(
        self,
        x: NDArray[np.float64],
        pairs: NDArray[np.int64],
        face: NDArray[np.int64],
        weights: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Return the vectors (k, 3) [m] from the second member of each pair to the first, with weights (k, 4)."""
        return x[self.pairs.first[pairs]] - np.einsum("ka,kai->ki", weights, x[self.pairs.carriers(pairs, face)])

    def _before(
        self, x: NDArray[np.float64], pairs: NDArray[np.int64], face: NDArray[np.int64], weights: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the result of `_away` in the last state, rotated with the faces to the points ``x`` (n + p, 3) [m]."""
        quads, last = self.pairs.carriers(pairs, face), self._from
        away = self._away(last, pairs, face, weights)
        return np.einsum("kij,klj,kl->ki", frames(x, quads), frames(last, quads), away)

    def _pack(self, found: Nearest, x: NDArray[np.float64]) -> None:
        """Write the pairs found at the points ``x`` (n + p, 3) [m] to the kernels' arrays.

        Persisting pairs keep their multipliers.
        """
        on = found.face >= 0
        corners = self.pairs.carriers(np.arange(self.pairs.count), found.face)
        give = self.pairs.give(self._yielding, corners, found.weights)
        on &= give > 0.0
        turned = np.einsum("ki,ki->k", self._normal, found.normal) < SAME_SIDE
        lost = ~on | turned
        self._press[lost], self._shear[lost] = 0.0, 0.0
        fresh = np.flatnonzero(on & (self._hold < 0))
        self._hold[fresh], self._hold_weights[fresh] = found.face[fresh], found.weights[fresh]
        away = self._away(x, fresh, found.face[fresh], found.weights[fresh])
        self._offset[fresh] = tangential(away, found.normal[fresh])
        self._normal, self._partners = found.normal, found.face
        chosen = np.flatnonzero(on)
        normal = found.normal[chosen]
        shear = tangential(self._shear[chosen], normal)
        self._chosen, self._face, self._weights = chosen, found.face[chosen], found.weights[chosen]
        self.integers[law.COUNT] = len(chosen)
        rows = self._rows()
        rows[:, law.PENALTY], rows[:, law.PRESS] = 1.0 / give[chosen], self._press[chosen]
        rows[:, law.NORMAL : law.WEIGHTS], rows[:, law.WEIGHTS : law.SHEAR] = normal, self._weights
        rows[:, law.SHEAR : law.HOLD], rows[:, law.HOLD : law.OFFSET] = shear, self._hold_weights[chosen]
        rows[:, law.OFFSET : law.SUPPORT], rows[:, law.SUPPORT] = self._offset[chosen], found.support[chosen]
        ends = self.integers[law.VERTICES : law.VERTICES + law.WIDTH * len(chosen)].reshape(-1, law.WIDTH)
        ends[:, law.VERTEX], ends[:, law.FACE : law.HELD] = self.pairs.first[chosen], corners[chosen]
        ends[:, law.HELD :] = self.pairs.carriers(chosen, self._hold[chosen])

    def _forces(self, positions: NDArray[np.float64]) -> tuple[NDArray, NDArray, NDArray, NDArray, NDArray]:
        """Return gaps (k,) [m], normal (k,) and friction forces (k, 3) [N], slip flags (k,) and slips (k, 3) [m]."""
        count = len(self._chosen)
        gaps, presses, slips = np.zeros(count), np.zeros(count), np.zeros(count, dtype=np.bool_)
        shears, slid = np.zeros((count, 3)), np.zeros((count, 3))
        law.pair_forces(positions, self.reals, self.integers, gaps, presses, shears, slips, slid)
        return gaps, presses, shears, slips, slid

    def _multipliers(self) -> NDArray[np.float64]:
        """Return normal force, friction force and scaled normal [N] of each pair (k, 7).

        The normals of pressing pairs are multiplied by the mean normal force, so that all columns have one unit.
        """
        rows, chosen, found = self._rows(), self._chosen, np.zeros((self.pairs.count, 7))
        found[chosen, 0], found[chosen, 1:4] = rows[:, law.PRESS], rows[:, law.SHEAR : law.HOLD]
        found[chosen, 4:] = self._scale * (rows[:, law.PRESS, None] > 0.0) * rows[:, law.NORMAL : law.WEIGHTS]
        return found

    def _rows(self) -> NDArray[np.float64]:
        return self.reals[law.HEAD : law.HEAD + law.STRIDE * len(self._chosen)].reshape(-1, law.STRIDE)

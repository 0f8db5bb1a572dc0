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
from gdfe_ros.solver.contact.contact_surface import BodyPoints
from gdfe_ros.solver.contact.contact_term import MARGIN, ContactTerm
from gdfe_ros.solver.contact.self_contact.closest import Nearest
from gdfe_ros.solver.contact.self_contact.own_pairs import NONE, OwnPairs, lay_out_pairs, slips_of
from gdfe_ros.solver.contact.self_contact.paired_forces import frames, touching_points
from gdfe_ros.solver.contact.self_contact.penetration import Inside
from gdfe_ros.solver.contact.stencil import PLANES, Stencils, Surfaces
from gdfe_ros.solver.contact.touch import NOTHING, Touch
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.state import Saved, State

REACH, FARTHEST_PAIR = 0.02, 0.25
"""The search distance for faces is the first number times the body's size, plus twice the step's largest displacement
relative to the surface's mean displacement. The second number times the body's size limits this sum.
"""
DEEPEST = 1e-4
"""Largest penetration depth, divided by the body's size, that is accepted at the end of a step."""
CLEAR = 1.5
"""Least search distance, divided by the larger of two depths of penetration: in the last accepted state, and at the
last search.
"""
VALID = 2.0
"""Largest relative displacement of a pair for which its plane is valid, divided by `Topology.depth`."""
SAME_SIDE = 0.5
"""A vertex keeps its forces if the cosine between its old and its new contact normal exceeds this."""


class OwnContact(ContactTerm):
    """Contact of the parts of a mesh with each other, and of each part with itself.

    During an iteration of the minimisation each vertex keeps its face and the plane of that face, and each sharp edge
    keeps the edge that it crosses and the plane along both. Before each iteration, faces, edges and planes are searched
    anew. The first search uses the positions of the last accepted state.

    Args:
        meant: the self-contact of the scene: faces that may touch, and friction.
        body: the discretised body.
    """

    def __init__(self, meant: SelfContact, body: Body) -> None:
        self.points = BodyPoints.of(body)
        self.pairs = OwnPairs(body, self.points, meant)
        self.surface = self.pairs.surface
        self.penetration = Inside(body, self.points, self.surface, meant)
        given = self.pairs.count, np.unique(self.points.carriers[self.surface.vertices])
        super().__init__(NAME, body, *given, friction=meant.friction, restitution=meant.restitution)
        self.shape = Surfaces.of(PLANES, 5 * self.points.carriers.shape[1], np.zeros(0))
        self._yielding, self.valid = np.zeros(0), VALID * self.surface.depth
        self._begins, self._clear, self._sound, self._clearance = False, False, False, 0.0
        self._aside = MARGIN * body.size + self.surface.rim  # pairs that stay farther apart take no part
        self._last: State | None = None
        self._reach, self._now = 0.0, Nearest.none(0)
        self._slid: NDArray[np.float64] | None = None
        count = self.pairs.count
        self._free |= {"normal": self._free["shear"], "face": np.full(count, -1.0), "weights": np.zeros((count, 4))}

    def fit(self, matrix: ConstantMatrix) -> None:
        """Set the points' compliances from the constant matrix' diagonal; vertices that handles drive have none."""
        self._yielding = self.points.compliance(self._body, matrix.assembled.diagonal())

    def set_targets(self, poses: Mapping[str, Pose], last: State) -> None:
        """Set the state from which pairs are searched: the anchor of ``last`` if it has one, else ``last`` itself."""
        self._last = last if last is None else last.anchor or last

    def begin(self, commands: Mapping[str, float], saved: Saved, positions: NDArray[np.float64], ratio: float) -> None:
        """Search the pairs. Start from the forces of the last step, rotated with their faces."""
        x, presses = self.points.at(positions), saved["press"].any()
        last = x if self._last is None else self.points.at(self._last.positions)
        self._from = self._seen = last
        far, self._slid = self.pairs.motion(x, last), None
        self._find_sunk()
        self._set_reach(x, 0.0)
        self._take_forces(saved, x)
        self._cleared, self._clearance = last, 0.0 if presses else self.pairs.clearance(last, self._reach)
        self._clear = not (presses or self._sunk.any()) and 0.5 * (self._clearance - self._aside) > far
        self._begins = far > self.surface.depth and not self._clear
        if self._clear:
            found = Nearest.none(self.pairs.count)
        else:
            found = self.pairs.look(last, last, self._reach, saved["face"].astype(np.int64), sunk=self._sunk)
            on = np.flatnonzero(found.face >= 0)
            before, after = (frames(at, self.pairs.carriers(on, found.face[on])) for at in (last, x))
            found.normal[on] = np.einsum("kij,klj,kl->ki", after, before, found.normal[on])
        self._choose(found, positions)
        self._deepest = 2.0 * far

    def _take_forces(self, saved: Saved, x: NDArray[np.float64]) -> None:
        """Set the forces of all pairs to those of a stored state, turned with their faces at the points ``x``."""
        some = np.flatnonzero(saved["face"] >= 0.0)
        axes = frames(x, self.pairs.carriers(some, saved["face"][some].astype(np.int64)))
        self._presses, self._shears, self._normals = saved["press"].copy(), saved["shear"].copy(), saved["normal"]
        self._shears[some] = np.einsum("kij,kj->ki", axes, saved["shear"][some])

    @property
    def near(self) -> bool:
        """Whether any pair may touch in the next step of the minimisation."""
        return super().near and not self._clear

    def room(self, positions: NDArray[np.float64]) -> float:
        """Return the distance [m] that vertices may move from ``positions`` (n, 3) [m] before parts are near others.

        It is 0 while any pair presses. The distance between two parts shrinks by at most twice the largest displacement
        relative to the mean displacement.
        """
        if self.acts:
            return 0.0
        moved = self.pairs.motion(self.points.at(positions), self._cleared)
        return 0.5 * (self._clearance - self._aside) - moved

    def follow(self, positions: NDArray[np.float64], ahead: float) -> None:
        """Search the pairs again at ``positions`` (n, 3) [m]; pairs that persist keep their forces.

        The search is left out if no parts can meet in the next displacement of at most ``ahead`` [m]. After a large
        displacement at the start of a solve, the pairs of the last state are used for one iteration, which moves
        entered vertices back.
        """
        self._clear = self.room(positions) > ahead
        if self._clear:
            return
        if self._begins:
            self._begins = False
            return
        x = self.points.at(positions.copy())  # the minimisation goes on in the same array
        self._presses[self._chosen], self._shears[self._chosen] = self.stencils.held[:, 0], self.stencils.shears
        self._set_reach(x, self._deepest)
        found = self.pairs.look(x, self._from, self._reach, self._partners, sunk=self._sunk)
        before, pressed = self._partners, self._presses > 0.0
        self._choose(found, positions)
        self.changed = bool((pressed & ((found.face != before) | (self._presses == 0.0))).any())
        if not pressed.any():
            self._cleared, self._clearance = x, self.pairs.clearance(x, self._reach)

    def lay_out(self, positions: NDArray[np.float64], stencils: Stencils) -> None:
        """Do `ContactTerm.lay_out` for the pairs.

        The vector from the second member of a pair to the first is x_v - sum w_a x_a. The slip is the change of its
        component in the plane since the last state, at the same material points.

        At its rim, a face carries only a fraction c of the force: c is 1 above the face, and 0 at the outer edge of the
        rim. The force acts through a spring of stiffness k c / (1 - c), with the stiffness k of the body at the pair.
        The vertex may enter as far as the spring yields. A vertex that slides over an edge is thus released
        gradually, and no equilibrium is skipped.
        """
        self._at = x = self.points.at(positions)
        if self._slid is not None:
            self._look_again(x)
        lay_out_pairs(
            self._firsts, self._corners, self._now.weights, self.points.carriers, self.points.weights, stencils
        )
        stencils.scale[...] = self._stiffness
        stencils.soft[...] = (1.0 - self._now.support) / (self._now.support * self._stiffness)
        # The place of a pair is the vector between its members: its plane goes through the origin.
        stencils.anchors[...], stencils.planes[:, :3] = self._anchors + self._turned, self._now.normal

    def finish(self, saved: Saved, positions: NDArray[np.float64]) -> Saved:
        """Do `ContactTerm.finish`; vectors are stored in the frames of the faces at ``positions``."""
        self._at = self.points.at(positions)
        return super().finish(saved, positions)

    def to_stored_axes(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return vectors (k, 3) in the frames of the faces."""
        axes = frames(self._at, self.pairs.carriers(self._chosen, self._now.face))
        return np.einsum("kji,kj->ki", axes, vectors)

    def keep_places(self, kept: Saved) -> None:
        """Write normals, faces and weights of the pairs."""
        for name in ("normal", "face", "weights"):
            kept[name][self._chosen] = getattr(self._now, name)

    def touch(
        self, saved: Saved, positions: NDArray[np.float64], poses: Mapping[str, Pose], origin: NDArray[np.float64]
    ) -> Touch:
        """Return the forces on both sides of all pairs; see `Contact.touch`."""
        on = np.flatnonzero(saved["push"])
        if not len(on):
            return NOTHING
        x, quads = self.points.at(positions), self.pairs.carriers(on, saved["face"][on].astype(np.int64))
        pairs = self.pairs.first[on], quads, saved["weights"][on], saved["normal"][on]
        shears = np.einsum("kij,kj->ki", frames(x, quads), saved["rub"][on])
        found = touching_points(x, pairs, saved["push"][on], shears, saved["slips"][on] > 0.0)
        main, points = self.points.vertices, self.points.numbers[found.vertices]
        others, places = main[found.others], found.places + origin
        return replace(found, vertices=main[found.vertices], others=others, places=places, points=points)

    def flaw(self, positions: NDArray[np.float64]) -> str:
        """Return a sentence about the deepest penetration, or an empty string if its depth is within `DEEPEST`.

        All surface vertices are checked, including vertices without a pair in the solve. All crossings of edges are
        checked, including edges that have passed each other since the last state.
        """
        if self._sound and self._last.summary.converged and self.room(positions) > 0.0:
            return ""  # nothing has come near since the last state, which was checked
        bound, x = DEEPEST * self._body.size, self.points.at(positions)
        depth, text = self.penetration.tell(x, bound)
        reach = REACH * self._body.size + 2.0 * self.pairs.motion(x, self._from)
        edges = NONE, self.pairs.kept.within(x, reach)[1]
        crossed = self.pairs.look(x, self._from, reach, self._partners, candidates=edges)
        deepest = int(crossed.gap.argmin())
        if -crossed.gap[deepest] > max(depth, bound):
            four = self.pairs.carriers([deepest], crossed.face[[deepest]])[0]
            text = self.penetration.sentence(*four[:2], x[four].mean(axis=0), -float(crossed.gap[deepest]))
        self._sound = not text
        return text

    def _set_reach(self, x: NDArray[np.float64], deepest: float) -> None:
        """Set the search distance for points ``x`` (n + p, 3) [m]; ``deepest`` [m] is the last penetration depth."""
        size = self._body.size
        reach = min(REACH * size + 2.0 * self.pairs.motion(x, self._seen), FARTHEST_PAIR * size)
        self._reach, self._seen = max(reach, CLEAR * max(deepest, self._least)), x

    def _find_sunk(self) -> None:
        """Mark the vertices that penetrated in the last state: contact pushes them out through their nearest face."""
        depths, last = np.zeros(len(self.surface.vertices)), self._last
        if last is not None and not last.summary.converged:
            depths, _ = self.penetration.depths(self._from, DEEPEST * self._body.size)
        self._sunk, self._least = depths > 0.0, float(depths.max())

    def _choose(self, found: Nearest, positions: NDArray[np.float64]) -> None:
        """Choose the pairs that were found at ``positions`` (n, 3) [m]. Persisting pairs keep their forces."""
        chosen, self._corners, give = self.pairs.choose(found, self._yielding)
        kept = np.zeros(self.pairs.count, dtype=np.bool_)
        kept[chosen] = np.einsum("ki,ki->k", self._normals[chosen], found.normal[chosen]) >= SAME_SIDE
        self._presses[~kept], self._shears[~kept] = 0.0, 0.0
        self._normals, self._partners = found.normal, found.face
        self._deepest = -float(found.gap.min(initial=0.0))
        self._chosen, self._firsts, self._stiffness = chosen, self.pairs.first[chosen], 1.0 / give
        self._now = Nearest(*(values[chosen] for values in found))
        self._anchors[...], self._turned = self._slip_before(), np.zeros((len(chosen), 3))
        self.lay_out(positions, self.hold_forces(self._presses[chosen], self._shears[chosen]))

    def _slip_before(self) -> NDArray[np.float64]:
        """Return the last state's vectors (k, 3) [m], along the planes, from the second to the first members of pairs.

        The vectors do not turn with the faces. All slips are then projections of one displacement field. Two vertices
        that touch each other, each in a pair of its own, therefore have consistent slips.
        """
        return slips_of(self._from, self._firsts, self._corners, self._now.weights, self._now.normal)

    def resume(self, commands: Mapping[str, float], saved: Saved, found: Saved, positions: NDArray[np.float64]) -> None:
        """Prepare the linearisation of a solve: choose the pairs that press at its end, with their forces and faces."""
        x = self.points.at(positions)
        near = self.pairs.look(x, x, REACH * self._body.size, found["face"].astype(np.int64))
        near.face[~(found["press"] > 0.0)] = -1
        self._slid, self._clear, self._from = None, False, self.points.at(self._last.positions)
        self._take_forces(found, x)
        self._choose(near, positions)
        if self.near:
            self._slid, self._solved = self._slip_before(), self._now
            self.lead(found, positions)

    def vary(self, commands: Mapping[str, float], saved: Saved, positions: NDArray[np.float64]) -> None:
        """Update the anchors of the chosen pairs; keep the choice of pairs."""
        if self.near:
            kept, self._from = self._from, self.points.at(self._last.positions)
            self._now = self._solved
            self._anchors[...] = self._slip_before() - self._led
            self._from = kept

    def _look_again(self, x: NDArray[np.float64]) -> None:
        """Update the closest points on the pairs' own faces to the points ``x`` (n + p, 3) [m], for derivatives."""
        found = self.pairs.nearest_to(x, self._chosen, self._now.face)
        on = found.face[self._chosen] >= 0  # a vertex that leaves its face sideways keeps its normal
        self._now = Nearest(*(new.copy() for new in self._solved))
        for new, now in zip(found, self._now, strict=True):
            now[on] = new[self._chosen[on]]
        self._turned = self._slip_before() - self._slid

# SPDX-License-Identifier: Apache-2.0
"""Contact forces of each quasi-Newton step: the step J d = p - p0 keeps the laws of contact, see `complementarity`.

A step without change of the forces is d = -H g. With the change df of the forces it is d = -H (g - J^T df), and the
gaps and slips at its end are p = p0 + J d. The forces f + df keep the laws between p and f.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.contact.complementarity import HALF, find_violations, solve_laws
from gdfe_ros.solver.contact.compliance import add_pairs, differentiate, join, project, pull, stack
from gdfe_ros.solver.contact.contact_term import FAINT, MARGIN, ROUNDING, ContactTerm
from gdfe_ros.solver.contact.kept_columns import ConstantColumns, HalvedColumns, KeptColumns
from gdfe_ros.solver.contact.pair_images import PairImages
from gdfe_ros.solver.contact.stencil import held_energy
from gdfe_ros.solver.descent.loop import Metric, choose_once
from gdfe_ros.solver.descent.workspace import Problem, Workspace, numbers
from gdfe_ros.solver.matrix.unknowns import Unknowns, add_rows, gather_rigid_rows

Product = Callable[[NDArray[np.float64]], NDArray[np.float64]]

ROUNDS = 8
"""Largest number of such rounds in one step; what is left enters the next step."""
EXACT = 1e-6
"""Allowed violation of the laws, divided by the length of the last step, or by the target of the minimisation."""
ROUGH = 1e-5
"""The laws are solved again if their violation, divided by the length of the step that they give, exceeds this."""
MOST_CHANGES = 30
"""Number of iterations in which surfaces touch other faces, while no step is half as long as the shortest one before,
or in which the laws are violated, and by no less than half of the least violation before: with more, contact does not
settle.
"""
NEARLY, SLIGHT = 5e-2, 5e-10
"""Violation of the laws that counts as nothing if less is out of reach, as where forces of redundant points are not
unique: divided by the target of the minimisation, and by the body's size.
"""
REVERSED, MOST_INERTIA, FADING = 0.7, 64.0, 0.7
"""A step reverses the last one if the cosine between both is below minus the first number. Forces and steps then get an
inertia of at least 1 and at most the second number, which fades by the last one in each step that does not reverse the
last one. It is the compliance against a change of a force, divided by that of the body at the point, and the fraction
1 / (1 + inertia) of each step is made.
"""
LISTED = 5
"""Number of vertices that a message names."""
LEAST_SLOPE = 0.1
"""A point takes no part where the gradient of its distance is shorter than this: in the middle of an obstacle."""


class Points(NamedTuple):
    """Contact points of all terms.

    Attributes:
        places: (k, 3) [m] gaps, with the length of the spring, and slips.
        axes: (k, 3, 3) directions of gap and slip.
        held: (k, 3) [N] present forces along these axes.
        soft: (k,) [m/N] compliance of the spring through which each normal force acts.
        rows, blocks, counts: derivatives with respect to the rows of unknowns, see `differentiate`.
        friction: (k,) friction coefficients.
        scale: (k,) [N/m] stiffness of the body at each point.
        vertices: (k,) a vertex that moves each point.
    """

    places: NDArray[np.float64]
    axes: NDArray[np.float64]
    held: NDArray[np.float64]
    soft: NDArray[np.float64]
    rows: NDArray[np.int64]
    blocks: NDArray[np.float64]
    counts: NDArray[np.int64]
    friction: NDArray[np.float64]
    scale: NDArray[np.float64]
    vertices: NDArray[np.int64]


class ContactForces:
    """Finds the contact forces of each step of a minimisation.

    Args:
        contacts: the contact terms.
        count: number n of vertices.
        unknowns: numbering of the unknowns.

    Attributes:
        contacts: the argument.
        left: largest violation [m] of the laws in the last step.
    """

    def __init__(self, contacts: Sequence[ContactTerm], count: int, unknowns: Unknowns) -> None:
        self.contacts = tuple(contacts)
        self._handle_of = np.full(count, -1, dtype=np.int64)
        for p in range(len(unknowns.slides)):
            self._handle_of[unknowns.members[unknowns.member_start[p] : unknowns.member_start[p + 1]]] = p
        self._rows, self._swings = 3 * unknowns.rows, any(contact.valid < np.inf for contact in contacts)
        self._turns = unknowns.rigid_rows > 0
        self.begin()
        self._row_of, self._numbered = np.full(count, -1, dtype=np.int64), None
        self._columns: dict[str, tuple[tuple[object, ...], KeptColumns]] = {}
        self._images = PairImages()
        self._w = self._between = np.zeros((0, 0))
        self._joined: tuple[NDArray[np.float64], ...] = (np.zeros(0),) * 4

    def begin(self) -> None:
        """Prepare a solve."""
        self.left, self._nearest, self._changes = 0.0, np.inf, 0
        self._least, self._in_vain, self._faint = np.inf, 0, 0.0
        self._last, self._inertia, self._head = np.zeros(self._rows), 0.0, 0

    @property
    def near(self) -> bool:
        """Whether any point is near an obstacle."""
        return any(contact.near for contact in self.contacts)

    def told(self) -> str:
        """Return the contacts in the last step, the vertices where the laws are violated most, and by how much."""
        names = ", ".join(contact.name for contact in self._acting)
        where = ", ".join(map(str, self._worst_vertices()))
        return f"{names}: {self.left:.3g} m of gap or slip remain, most at vertices {where}"

    def _worst_vertices(self) -> NDArray[np.int64]:
        """Return up to `LISTED` vertices, ascending, where the laws are violated by more than half of the most."""
        vertices, *given = self._unsolved
        found = np.empty(len(vertices))
        find_violations(*given, found)
        order = np.argsort(-found, kind="stable")[:LISTED]
        return np.unique(vertices[order[found[order] > 0.5 * found.max(initial=0.0)]])

    def follow(self, problem: Problem, work: Workspace) -> None:
        """Choose the points again of contacts that hold forces, which turn with the surfaces; correct the gradient."""
        acting = [contact for contact in self.contacts if contact.acts]

        def choose_again() -> None:
            for contact in acting:
                contact.follow(work.x, np.inf)

        if acting:
            before = work.gradient.copy()
            self._exchange(problem, work, choose_again)
            self._curve(work, work.gradient - before)
        self._waiting = [contact for contact in self.contacts if contact not in acting]

    def _curve(self, work: Workspace, change: NDArray[np.float64]) -> None:
        """Add to the newest pair the ``change`` (3 r,) [N] of the gradient by forces that turned in the last step.

        The pairs thus contain the curvature of the surfaces: forces turn where a point moves along them.
        """
        status = numbers(work)
        newest, fresh = (int(status["head"]) - 1) % len(work.curvature), status["head"] != self._head
        self._head = int(status["head"])
        if not (status["count"] and fresh):
            return
        curvature = work.curvature[newest] + float(work.steps[newest] @ change)
        if curvature > 0.0:
            work.changes[newest] += change
            work.curvature[newest] = curvature

    def approach(self, work: Workspace) -> bool:
        """Choose the points again of the other contacts, before the step in ``work``; return whether any is near."""
        # The rows of turning handles are no displacements of vertices.
        ahead = np.inf if self._turns else float(numbers(work)["step"])
        for contact in self._waiting:
            contact.follow(work.x, ahead)
        return self.near

    @property
    def settled(self) -> bool:
        """Whether the faces that touch, and the forces on them, have settled or may still do so."""
        return max(self._changes, self._in_vain) <= MOST_CHANGES

    def settles(self, work: Workspace) -> bool:
        """Count iterations with other faces, and those whose laws have no solution; return whether both may settle."""
        nearest, step = float(numbers(work)["nearest"]), float(numbers(work)["step"])
        if self.left <= max(HALF * self._least, ROUGH * step, self._faint):
            self._least, self._in_vain = self.left, 0
        self._in_vain += self.left > max(ROUGH * step, self._faint)
        if nearest != self._nearest:
            self._nearest, self._changes = nearest, 0
        self._changes += any(contact.changed for contact in self.contacts)
        return self.settled

    def answer(
        self, problem: Problem, work: Workspace, metric: Metric, key: tuple[object, ...], size: float, target: float
    ) -> int:
        """Find the forces with which the step keeps the laws, and write that step; return the result of `choose`.

        ``problem``, ``work`` and ``metric`` are those of the minimisation; the step without new forces is in
        ``work.direction``. ``key`` is the identity of the initial matrix, ``size`` [m] the body's size, and ``target``
        [m] the distance to the equilibrium that the minimisation allows.
        """
        points = self._points(problem, work)
        ahead, held, found = np.empty_like(points.places), points.held.copy(), 2
        project(work.direction, points.rows, points.blocks, points.counts, ahead)
        usable = (np.abs(points.axes[:, 0]).max(axis=1) > LEAST_SLOPE) & (points.counts > 0)
        joins = usable & ((points.places[:, 0] + ahead[:, 0] < MARGIN * size) | held.any(axis=1))
        status = numbers(work)
        self.left, allowed = 0.0, EXACT * max(target, min(float(status["before"]), float(status["step"])))
        dropped = held.any(axis=1) & ~usable
        self._faint = faint = max((FAINT if self._swings else SLIGHT) * size, NEARLY * target)
        known: tuple[int, int] | None = None
        before = np.inf  # violation after the last round
        for _ in range(ROUNDS):
            chosen = np.flatnonzero(joins)
            forces = np.where(dropped[:, None], 0.0, held)
            if len(chosen):
                if known != (len(chosen), int(status["wild"])):
                    w = self._compliance(problem, work, metric, key, points, chosen)
                    known = len(chosen), int(status["wild"])
                    if self._swings:
                        w[np.diag_indices(len(w))] += np.repeat(self._inertia / points.scale[chosen], 3)
                there, start = (points.places + ahead)[chosen].ravel(), held[chosen].ravel()
                given, now = there - w @ start, start.copy()
                self.left = solve_laws(w, given, points.friction[chosen], now, allowed, faint)
                forces[chosen] = now.reshape(-1, 3)
                self._unsolved = points.vertices[chosen], w, given, points.friction[chosen], now
            if np.array_equal(forces, held):
                break
            self._hold(forces, problem, work)
            held = forces
            found = choose_once(problem, work, metric, size, 2**62)
            project(work.direction, points.rows, points.blocks, points.counts, ahead)
            enters = usable & ~joins & (points.places[:, 0] + ahead[:, 0] < -target)
            rough = self.left > max(faint, ROUGH * max(target, float(status["step"])))
            if not ((rough and self.left < HALF * before) or enters.any()):
                break
            before = self.left
            joins |= enters
            allowed = EXACT * max(target, float(status["step"]))
        self._shorten(work, ahead)
        return found

    def _shorten(self, work: Workspace, ahead: NDArray[np.float64]) -> None:
        """Shorten the step if it swings, or if points move farther past what they touch than their stencils hold.

        The distance to the equilibrium is still measured by the whole step.
        """
        if not self._swings:
            return
        self._watch(work.direction)
        first, share = 0, 1.0 / (1.0 + self._inertia)
        for contact in self._acting:
            last = first + contact.count
            longest = float(np.sqrt(np.square(ahead[first:last]).sum(axis=1).max(initial=0.0)))
            share, first = min(share, contact.valid / max(longest, 1e-300)), last
        if share < 1.0:
            work.direction[...] *= share
            numbers(work)["slope"] *= share

    def _watch(self, step: NDArray[np.float64]) -> None:
        """Double the inertia if a ``step`` (3 r,) [m] reverses the last one; otherwise it fades.

        Faces that touch are found anew before each step. Forces may then change from one side to the other and back,
        and turn back and forth with their normals.
        """
        reverses = self._last @ step < -REVERSED * np.sqrt((self._last @ self._last) * (step @ step))
        self._inertia = min(max(1.0, 2.0 * self._inertia), MOST_INERTIA) if reverses else FADING * self._inertia
        self._last = step.copy()

    def supported(self, problem: Problem, work: Workspace, product: Product) -> Product:
        """Return ``product``, the product with the body's tangent, plus springs where points press or stick.

        The body is stable if its tangent is positive definite for the motions that the contacts leave. Springs as stiff
        as the body stand for the other motions.
        """
        if not self.near:
            return product
        points = self._points(problem, work)
        press, shear = points.held[:, 0], np.linalg.norm(points.held[:, 1:], axis=1)
        sticks = (press > 0.0) & (shear < (1.0 - ROUNDING) * points.friction * press)
        springs = points.scale[:, None] * np.column_stack([press > 0.0, sticks, sticks])
        given = points.rows, points.blocks, points.counts

        def multiply(direction: NDArray[np.float64]) -> NDArray[np.float64]:
            image, way = product(direction), np.empty_like(points.places)
            project(direction, *given, way)
            pull(springs * way, *given, image)
            return image

        return multiply

    def _points(self, problem: Problem, work: Workspace) -> Points:
        """Return the contact points of all terms at the present positions."""
        unknowns = problem.unknowns
        if self._numbered is not unknowns:
            self._row_of[...] = -1
            self._row_of[unknowns.free] = np.arange(len(unknowns.free))
            self._numbered = unknowns
        self._acting, parts = [contact for contact in self.contacts if contact.near], []
        for contact in self._acting:
            places, axes, held, soft, ends, pressing, rubbing = contact.stencils
            places = places.copy()
            places[:, 0] += soft * held[:, 0]
            count, width = ends.shape
            rows, blocks = np.zeros((count, 2 * width), np.int64), np.zeros((count, 2 * width, 3, 3))
            counts = np.zeros(count, np.int64)
            given = work.x, work.u, problem.frame, unknowns, self._row_of, self._handle_of
            differentiate(*given, axes, ends, pressing, rubbing, rows, blocks, counts)
            friction = np.full(count, contact.friction)
            parts.append((places, axes, held, soft, rows, blocks, counts, friction, contact.scale, ends[:, 0]))
        rows, blocks = stack([part[4:6] for part in parts])
        joined = [np.concatenate([part[k] for part in parts]) for k in (0, 1, 2, 3, 6, 7, 8, 9)]
        return Points(*joined[:4], rows, blocks, *joined[4:])

    def _hold(self, forces: NDArray[np.float64], problem: Problem, work: Workspace) -> None:
        """Set the forces (k, 3) [N] of all points."""
        ends = np.cumsum([contact.count for contact in self._acting])[:-1]

        def hold() -> None:
            for contact, part in zip(self._acting, np.split(forces, ends), strict=True):
                contact.hold_forces(part)

        self._exchange(problem, work, hold)

    def _exchange(self, problem: Problem, work: Workspace, change: Callable[[], None]) -> None:
        """Call ``change``, which gives other contact forces, and correct energy and gradient for them."""
        slopes, energies = np.zeros((2, *work.x.shape)), np.zeros(2)
        for place in range(2):
            for contact in self.contacts:
                if contact.near:
                    given = work.x, contact.reals, contact.integers, slopes[place], np.zeros(1)
                    energies[place] += held_energy(*given)
            if place == 0:
                change()
        numbers(work)["energy"] += energies[1] - energies[0]
        slopes[1] -= slopes[0]
        if not slopes[1].any():
            return
        work.outside[...] += slopes[1]
        add_rows(slopes[1], problem.unknowns, work.gradient)
        if problem.unknowns.rigid_rows:
            given = work.u, work.x, work.force, work.outside, True, problem.frame, problem.unknowns
            gather_rigid_rows(*given, work.gradient)

    def _compliance(
        self,
        problem: Problem,
        work: Workspace,
        metric: Metric,
        key: tuple[object, ...],
        points: Points,
        chosen: NDArray[np.int64],
    ) -> NDArray[np.float64]:
        """Return W (3 c, 3 c) [m/N] of the ``chosen`` points; J M^-1 J^T is kept while nothing in it changes."""
        status = numbers(work)
        constant = bool(status["wild"]) or not len(metric.kept.order)
        kept = self._kept("constant" if constant else "tangent", problem, metric, key)
        used = np.arange(points.rows.shape[1]) < points.counts[chosen, None]
        rows = np.unique(points.rows[chosen][used])
        kept.include(rows)
        number = np.full(len(work.u) // 3, -1, dtype=np.int64)
        number[rows] = np.arange(len(rows))
        scale = float(status["scale"]) if status["wild"] else 1.0
        frames = np.zeros((0, 9)) if constant else metric.kept.frames
        given, between = (chosen, points.rows, points.blocks, points.counts), kept.between(rows)
        now = np.array(scale), points.rows[chosen], points.blocks[chosen], frames
        if between is not self._between or not all(map(np.array_equal, now, self._joined)):
            self._between, self._joined = between, (*now[:3], frames.copy())
            self._w = np.empty((3 * len(chosen), 3 * len(chosen)))
            join(*given, number, between, frames, scale, self._w)
        w = self._w.copy()
        if status["count"]:
            images = self._images.of(work, metric, (*key, constant, scale), frames)
            add_pairs(work, images, *given, w)
        w[range(0, len(w), 3), range(0, len(w), 3)] += points.soft[chosen]
        return w

    def _kept(self, kind: str, problem: Problem, metric: Metric, key: tuple[object, ...]) -> KeptColumns:
        """Return the kept columns of the tangent or of the constant matrix; those of an earlier matrix are dropped."""
        key = (metric.coupling.inverse_schur, problem.unknowns.free) if kind == "constant" else key
        known = self._columns.get(kind)
        if known is not None and len(known[0]) == len(key) and all(a is b for a, b in zip(known[0], key, strict=True)):
            return known[1]
        if kind == "constant":
            free = problem.unknowns.free
            found = ConstantColumns(metric.coupling, self._rows_of(free), len(free))
        else:
            found = HalvedColumns(metric.kept)
        self._columns[kind] = key, found
        return found

    def _rows_of(self, free: NDArray[np.int32]) -> NDArray[np.int64]:
        """Return the rows, ascending, of the ``free`` vertices that any contact point may involve."""
        ends = np.unique(np.concatenate([contact.vertices for contact in self.contacts]))
        return np.flatnonzero(np.isin(free, ends))

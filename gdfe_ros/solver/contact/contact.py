# SPDX-License-Identifier: Apache-2.0
"""Term of the potential for the contact of points with one obstacle or rigid body."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.obstacle import ArmLink, ContactPoints, Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact import gap, held_forces
from gdfe_ros.solver.contact.contact_term import FAINT, ContactTerm, Stencils
from gdfe_ros.solver.contact.gap import ANCHOR, HEAD, NORMAL, OFFSET, PLANE, PRESS, SHEAR, STRIDE, VERTICES, WEIGHTS
from gdfe_ros.solver.contact.skin import Skin
from gdfe_ros.solver.contact.surface import SHAPE, TURNED, ContactSurface, Corners
from gdfe_ros.solver.contact.touch import NOTHING, Touch
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.state import Saved, State
from gdfe_ros.solver.vectors import largest_distance

ENTRY = 1e-3
"""A point counts as outside if its distance from the obstacle, divided by the body's size, exceeds this. A point that
moves from outside into the obstacle within one step gets an entry plane: the tangent plane of the obstacle where the
point entered. Contact pushes the point back across this plane, and not out of the obstacle on another side.
"""
REACH = 0.05
"""Points take part in contact if their distance from the obstacle, divided by the body's size, is below this. Distances
are computed again after the body has moved by half of this. If every point was farther away, they are computed again
only after a motion that may bring a point within this distance.
"""
SLIP = 3e-7
"""Slip, divided by the body's size, that the linearisation assumes for a slipping point whose own slip is smaller."""
HELD = [PRESS, SHEAR, SHEAR + 1, SHEAR + 2, NORMAL, NORMAL + 1, NORMAL + 2, OFFSET]
"""Columns of a point's row that are multipliers: a solve changes them, and the sensitivities differentiate them."""


class Contact(ContactTerm):
    """Contact of points with an obstacle or a rigid body.

    Args:
        name: name of the term.
        touched: the obstacle or rigid body that the points must stay outside of.
        body: the discretised body.
        points: the points that must stay outside.
        friction: Coulomb's coefficient.
    """

    kernel, potential = held_forces.contact_entry, staticmethod(held_forces.contact_energy)
    _FRICTION, _HEAD, _STRIDE, _PRESS = gap.FRICTION, HEAD, STRIDE, PRESS

    def __init__(
        self, name: str, touched: Obstacle, body: Body, points: ContactSurface | Corners, friction: float
    ) -> None:
        self._touched, self._points, self._radius = touched, points, 0.0
        count, carriers = points.carriers.shape
        reals = np.concatenate([np.zeros(HEAD + STRIDE * count), touched.form.samples])
        integers = np.zeros(VERTICES + carriers * count, dtype=np.int32)
        reals[gap.NUMBERS : gap.FRICTION], reals[gap.FRICTION] = touched.form.numbers, friction
        integers[gap.KIND], integers[gap.CARRIERS], integers[gap.RUB] = touched.form.kind, carriers, WEIGHTS
        integers[gap.BODY : gap.RUB] = touched.vertices if isinstance(touched, RigidBody) else -1
        if isinstance(touched, RigidBody):
            reals[gap.SIGNS : HEAD] = touched.signs.ravel()
        super().__init__(name, body, reals, integers)
        self.restitution = touched.restitution
        self._scale, self._held_fast = np.zeros(count), np.zeros(count, dtype=bool)
        self._distances, self._normals = np.zeros(count), np.zeros((count, 3))
        self._faces = np.zeros(0, dtype=np.int64)
        self._clear, self._lag, self._led = -np.inf, 0.0, np.zeros((0, 3))
        self._pose = self._seen_at = Pose()
        self._last: State | None = None
        self._seen: NDArray[np.float64] | None = None
        none = np.zeros((count, 3))
        self._free = {
            "press": np.zeros(count),
            "shear": none,
            "anchor": none + np.nan,
            "slips": np.ones(count),
            "push": np.zeros(count),
            "rub": none,
        }

    @property
    def on_body(self) -> bool:
        """Whether the points belong to the elastic body."""
        return isinstance(self._points, ContactSurface)

    @property
    def inside(self) -> bool:
        """Whether any point was inside the obstacle when the distances were last computed."""
        return bool(self._distances.min(initial=0.0) < -FAINT * self._body.size)

    @property
    def scale(self) -> NDArray[np.float64]:
        """Stiffnesses (k,) [N/m] of the body at the chosen points."""
        return self._scale[self._chosen]

    def fit(self, matrix: ConstantMatrix) -> None:
        """Take the stiffnesses that scale `held_forces.project_forces` from the constant matrix' diagonal."""
        self._scale = self._points.stiffness(matrix.assembled.diagonal())

    def leave_out(self, held: Sequence[tuple[str, NDArray[np.int32]]]) -> None:
        """Leave out points that something else holds in their places: a grip's and a contact's forces would add up.

        Args:
            held: name of an obstacle or rigid body, and the vertices that keep their places on it.
        """
        own = [vertices for name, vertices in held if name == self._touched.name]
        carriers = self._points.carriers
        self._held_fast = np.zeros(len(carriers), dtype=bool)
        for vertices in own:
            self._held_fast |= np.isin(carriers, vertices).all(axis=1)

    def ends(self) -> NDArray[np.int32]:
        """Return the vertices (k, c) on which each point's force acts.

        These are the point's carriers, then the four vertices of the touched rigid body, if a rigid body is touched.
        """
        ends = self._points.carriers
        if isinstance(self._touched, RigidBody):
            ends = np.column_stack([ends, np.tile(self._touched.vertices, (len(ends), 1))])
        return ends

    def neutral(self) -> Saved:
        """Return the stored state without contact: no forces, no anchors, no dissipated energy."""
        return {**self._free, "lost": np.zeros(1)}

    def aim(self, poses: Mapping[str, Pose], last: State) -> None:
        """Set the commanded pose of the obstacle and the state at the end of the last step."""
        self._pose, self._last = poses[self._touched.name], last

    def begin(self, commands: Mapping[str, float], saved: Saved, positions: NDArray[np.float64], ratio: float) -> None:
        """Choose the points near the obstacle. Start from the last step's multipliers, rotated with the obstacle."""
        free = saved["press"] is self._free["press"] or not saved["press"].any()
        self._saved = saved
        self._lag = self._shifted(positions)
        if free and self._lag + self._moved(positions) < self._clear:
            self._take_none()
        else:
            self._choose(saved, positions)

    def follow(self, positions: NDArray[np.float64], ahead: float) -> None:
        """Choose the points again if the body has moved far enough; correct the offsets of the chosen points."""
        if self._moved(positions) < max(self._clear - self._lag, 0.5 * REACH * self._body.size):
            self._correct(positions)
            return
        rows = self._rows()
        self._choose({**self._saved, **self._spread(rows[:, PRESS], rows[:, SHEAR : SHEAR + 3])}, positions)

    def stencils(self, positions: NDArray[np.float64]) -> Stencils:
        """Return what the complementarity problem needs of the chosen points at ``positions`` (n, 3) [m]."""
        found = Stencils.empty(self.count, self.ends().shape[1])
        held_forces.stencils(positions, self.reals, self.integers, *found)
        return found

    def present_stencils(self, positions: NDArray[np.float64]) -> Stencils:
        """Return `stencils` whose friction acts on a touched rigid body at the points' present places."""
        found = self.stencils(positions)
        if isinstance(self._touched, RigidBody):
            found.rubbing[:, -4:] = -0.25 - self._in_frame(self._rubbing(positions)) @ self._touched.signs.T
        return found

    def hold_forces(self, axes: NDArray[np.float64], forces: NDArray[np.float64]) -> None:
        """Set the forces (k, 3) [N] of the chosen points along ``axes`` (k, 3, 3)."""
        held_forces.hold_forces(axes, forces, self.reals, self.integers)

    def finish(self, saved: Saved, positions: NDArray[np.float64]) -> Saved:
        """Return the state to store: contact forces, and the anchors of the sticking points.

        Points that slip store no anchor. In the next step, their anchors are their positions at its start. The entry
        ``lost`` is the energy dissipated by friction so far [J].
        """
        if not self.near:
            return {**self._free, "lost": saved["lost"]}
        forces, presses, shears, slips = self._forces(positions)
        slips |= ~(presses > 0.0)
        anchor, slipping = self._free["anchor"].copy(), self._free["slips"].copy()
        anchor[self._chosen[~slips]], slipping[self._chosen] = self._kept(self._rubbing(positions))[~slips], slips
        kept = {**self._spread(presses, -shears), "anchor": anchor, "slips": slipping}
        return self.exerted(saved, kept, positions, np.linalg.norm(forces - shears, axis=1), shears)

    def exerted(
        self,
        saved: Saved,
        kept: Saved,
        positions: NDArray[np.float64],
        pushes: NDArray[np.float64],
        shears: NDArray[np.float64],
    ) -> Saved:
        """Return the state ``kept`` after a step from ``saved``, with the mean forces on the chosen points in the step.

        These are the normal forces ``pushes`` (k,) and the friction forces ``shears`` (k, 3) [N].
        """
        slips, rubs = kept["slips"][self._chosen] > 0.0, shears @ self._axes
        slid = self._in_frame(self._rubbing(positions)) - self._rows()[:, ANCHOR : ANCHOR + 3]
        push, rub = np.zeros(len(self._scale)), np.zeros((len(self._scale), 3))
        push[self._chosen], rub[self._chosen] = pushes, rubs
        lost = saved["lost"] - np.einsum("ki,ki->", rubs[slips], slid[slips])
        return {**kept, "push": push, "rub": rub, "lost": lost}

    def resume(self, commands: Mapping[str, float], saved: Saved, found: Saved, positions: NDArray[np.float64]) -> None:
        """Prepare the linearisation of a solve: choose the points in contact at its end, with their contact forces.

        The direction of slip must be defined. A slipping point that has hardly moved therefore gets an additional slip
        of `SLIP` times the body's size in the direction of its friction force.
        """
        self._led = np.zeros((0, 3))
        if not found["press"].any():
            self._take_none()
            return
        self._choose({**saved, "press": found["press"], "shear": found["shear"]}, positions)
        rows = self._rows()
        length = np.linalg.norm(rows[:, NORMAL : NORMAL + 3], axis=1)[:, None]
        rows[:, NORMAL : NORMAL + 3] /= np.where(length > 0.0, length, 1.0)
        shears = rows[:, SHEAR : SHEAR + 3] @ self._axes
        size = np.linalg.norm(shears, axis=1)
        slid = self._in_frame(self._rubbing(positions)) - rows[:, ANCHOR : ANCHOR + 3]
        still = np.linalg.norm(slid, axis=1) < SLIP * self._body.size
        on = (found["slips"][self._chosen] > 0.0) & (size > 0.0) & still
        self._led = SLIP * self._body.size * shears / np.where(size > 0.0, size, 1.0)[:, None] * on[:, None]
        rows[:, ANCHOR : ANCHOR + 3] -= self._led

    def vary(self, commands: Mapping[str, float], saved: Saved, positions: NDArray[np.float64]) -> None:
        """Update the obstacle's frame and the anchors of the chosen points; keep the choice of points."""
        if not self.near:
            return
        self._origin[...], self._axes[...] = self._frame(positions, self._pose)
        self._rows()[:, ANCHOR : ANCHOR + 3] = self._anchors(saved, positions) - self._led

    @property
    def multipliers(self) -> NDArray[np.float64]:
        """Normal forces, friction forces [N], normals and offsets [m] of the chosen points, flattened (8 k,)."""
        return self._rows()[:, HELD].ravel()

    @property
    def per_metre(self) -> NDArray[np.float64]:
        """Expected change of each multiplier per metre (8 k,): stiffness [N/m], 1 / size for normals, 1 for offsets."""
        k, one = self._rows()[:, gap.SCALE], np.ones(len(self._chosen))
        turned = one / self._body.size
        return np.stack([k, k, k, k, turned, turned, turned, one], axis=1).ravel()

    def hold(self, multipliers: NDArray[np.float64]) -> None:
        """Set the multipliers (8 k,) of the chosen points."""
        self._rows()[:, HELD] = multipliers.reshape(-1, len(HELD))

    def updated(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the multipliers (8 k,) after one plain update; the term's own multipliers stay unchanged."""
        held = self.multipliers
        if not self.near:
            return held
        held_forces.project_forces(positions, self.reals, self.integers)
        self._correct(positions)
        found = self.multipliers
        self.hold(held)
        return found

    def wrench(self, positions: NDArray[np.float64], saved: Saved | None = None) -> NDArray[np.float64]:
        """Return the obstacle's wrench (6,) on the points: force [N], then moment [N m] about the obstacle's origin.

        It is that of the mean forces in the stored state ``saved`` of the term, or else of the multipliers.
        """
        if not self.near:
            return np.zeros(6)
        forces = self._forces(positions)[0]
        if saved is not None:
            normals = self._rows()[:, NORMAL : NORMAL + 3]
            length = np.linalg.norm(normals, axis=1, keepdims=True)
            normals = normals / np.where(length > 0.0, length, 1.0)
            forces = saved["push"][self._chosen, None] * normals + saved["rub"][self._chosen] @ self._axes.T
        arms = self._rubbing(positions) - self._origin
        return np.concatenate([forces.sum(axis=0), np.cross(arms, forces).sum(axis=0)])

    def led(self, positions: NDArray[np.float64], before: State) -> NDArray[np.float64]:
        """Return the obstacle's displacement (k, 3) [m] at the chosen points since the state ``before``.

        The displacement of a touched rigid body is that of its vertices.
        """
        if isinstance(self._touched, RigidBody):
            return np.zeros((self.count, 3))
        places = self._points.at(positions)[self._chosen]
        origin, axes = self._frame(before.positions, before.poses[self._touched.name])
        return places - origin - self._in_frame(places) @ axes.T

    def touch(self, state: State, origin: NDArray[np.float64]) -> Touch:
        """Return the contacts and forces stored in ``state``; its positions are relative to ``origin`` (3,) [m]."""
        saved = state.terms[self.name]
        if saved["press"] is self._free["press"]:
            return NOTHING
        on = np.flatnonzero(saved["push"])
        if not len(on):
            return NOTHING
        middle, axes = self._frame(state.positions, state.poses[self._touched.name])
        places, gaps, normals = self._points.at(state.positions)[on], np.empty(len(on)), np.empty((len(on), 3))
        form = self._touched.form
        head = np.concatenate([axes.ravel(), middle, form.numbers, form.samples])
        gap.distances(places, head, form.kind, gaps, normals)
        length = np.linalg.norm(normals, axis=1, keepdims=True)  # below 1 at a mesh's edges
        return Touch(
            vertices=self._points.vertices[on] if self.on_body else np.zeros(0, dtype=np.int32),
            points=self._points.points[on] if isinstance(self._points, Skin) else np.zeros(0, dtype=np.int32),
            places=places - self._radius * normals + origin,
            normals=normals / np.maximum(length, np.finfo(float).tiny),
            gaps=gaps - self._radius,
            presses=saved["push"][on],
            shears=saved["rub"][on] @ axes.T,
            slips=saved["slips"][on] > 0.0,
        )

    @property
    def _origin(self) -> NDArray[np.float64]:
        return self.reals[gap.ORIGIN : gap.NUMBERS]

    @property
    def _axes(self) -> NDArray[np.float64]:
        return self.reals[gap.AXES : gap.ORIGIN].reshape(3, 3)

    def _frame(self, positions: NDArray[np.float64], pose: Pose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return origin (3,) [m] and rotation (3, 3) of the touched obstacle or rigid body."""
        if isinstance(self._touched, RigidBody):
            return self._touched.found(positions)
        return self._touched.frame(pose)

    def _entered(self, starts: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the entry planes (p, 4) of points that move on straight lines to ``places`` (p, 3) [m].

        The row of a point is zero if the point does not enter the obstacle, or if it moved by less than `ENTRY` times
        the body's size. The positions ``starts`` (p, 3) [m] are in the obstacle's frame.
        """
        planes, ends, reach = np.zeros((len(places), 4)), self._in_frame(places), ENTRY * self._body.size
        moved = ends - starts
        fast = np.flatnonzero(np.einsum("pi,pi->p", moved, moved) > reach * reach)
        if len(fast):
            found = np.zeros((len(fast), 4))
            gap.entries(starts[fast], ends[fast], reach, self.reals, self._touched.form.kind, found)
            planes[fast] = found
        return planes

    def _starts(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the positions (p, 3) [m] of the points at the end of the last step, in the obstacle's frame.

        If there is no last step, these are the positions ``places`` (p, 3) [m] in the obstacle's frame.
        """
        if self._last is None:
            return self._in_frame(places)
        origin, axes = self._frame(self._last.positions, self._last.poses[self._touched.name])
        return (self._points.at(self._last.positions) - origin) @ axes

    def _moved(self, positions: NDArray[np.float64]) -> float:
        """Return an upper bound of the displacement [m] of any point since the distances were computed."""
        if self._seen is None:
            return np.inf
        longest = largest_distance(positions, self._seen)
        return longest * max(TURNED if isinstance(self._touched, RigidBody) else 1.0, self._points.reach)

    def _shifted(self, positions: NDArray[np.float64]) -> float:
        """Return an upper bound of any point's relative displacement [m] that the obstacle's motion causes.

        The motion counts from the last computation of the distances. A finite bound is computed only for links of arms,
        because an arm has many links and most are far from any contact. For any other obstacle that moved, the bound is
        infinite, so that its distances are computed again.
        """
        if self._pose == self._seen_at:
            return 0.0
        if not isinstance(self._touched, ArmLink):
            return np.inf
        seen, now = self._seen_at, self._pose
        # The angle between two rotations is at most the distance of their rotation vectors.
        angle, shift = math.dist(seen.rotation, now.rotation), math.dist(seen.translation, now.translation)
        middle = np.add(self._touched.origin, seen.translation)
        farthest = math.sqrt(3.0) * float(np.abs(positions - middle).max(initial=0.0)) * max(1.0, self._points.reach)
        return shift + angle * farthest

    def _take_none(self) -> None:
        self._chosen = self._faces = np.zeros(0, dtype=np.int64)
        self.integers[gap.COUNT] = 0

    def _in_frame(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        return (places - self._origin) @ self._axes

    def _choose(self, saved: Saved, positions: NDArray[np.float64]) -> None:
        """Choose the points that are near at ``positions`` (n, 3) [m], touched in the last step, or enter now."""
        points, integers, places = self._points, self.integers, self._points.at(positions)
        self._origin[...], self._axes[...] = self._frame(positions, self._pose)
        self._measure(places)
        self._seen, self._seen_at, self._lag = positions.copy(), self._pose, 0.0
        self._clear = self._distances.min(initial=np.inf) - REACH * self._body.size
        starts = self._starts(places)
        planes = self._entered(starts, places)
        entered = planes[:, :3].any(axis=1)
        near = (self._distances < REACH * self._body.size) | (saved["press"] > 0.0) | entered
        chosen = np.flatnonzero(near & ~self._held_fast)
        self._chosen, integers[gap.COUNT] = chosen, len(chosen)
        integers[VERTICES : VERTICES + len(chosen) * integers[gap.CARRIERS]] = points.carriers[chosen].ravel()
        rows, press = self._rows(), saved["press"][chosen]
        rows[:, gap.SCALE], rows[:, PRESS] = self._scale[chosen], press
        rows[:, WEIGHTS : WEIGHTS + points.weights.shape[1]] = points.weights[chosen]
        rows[:, PLANE : PLANE + 4], rows[:, gap.FIXED] = planes[chosen], 0.0
        rows[:, SHEAR : SHEAR + 3] = saved["shear"][chosen] @ self._axes.T
        rows[:, ANCHOR : ANCHOR + 3] = self._anchored(saved, starts)
        came = entered[chosen][:, None]
        rows[:, NORMAL : NORMAL + 3] = np.where(came, planes[chosen, :3] @ self._axes.T, self._normals[chosen])
        self._faces = points.about(chosen) if self._touched.points is ContactPoints.FACES else np.zeros(0, np.int64)
        self._correct(positions)

    def _measure(self, places: NDArray[np.float64]) -> None:
        """Write the distances [m] and normals of all points at ``places`` (p, 3) [m] to the term's arrays."""
        gap.distances(places, self.reals, self.integers[gap.KIND], self._distances, self._normals)

    def _anchors(self, saved: Saved, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the anchors (k, 3) [m] of the chosen points at the start of a step, in the obstacle's frame."""
        return self._anchored(saved, self._starts(self._points.at(positions)))

    def _anchored(self, saved: Saved, starts: NDArray[np.float64]) -> NDArray[np.float64]:
        anchors = saved["anchor"][self._chosen]
        return np.where(np.isnan(anchors), starts[self._chosen], anchors)

    def _kept(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the anchors (k, 3) [m] that the state stores for the chosen points at ``places`` (k, 3) [m]."""
        return self._rows()[:, ANCHOR : ANCHOR + 3]

    def _rubbing(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the positions (k, 3) [m] at which friction acts on the chosen points."""
        return self._points.at(positions)[self._chosen]

    def _correct(self, positions: NDArray[np.float64]) -> float:
        """Update the offsets of the points (see `held_forces`); return the largest change [m]."""
        if not len(self._faces):
            return 0.0
        surface, faces = self._points, self._faces
        nearer = np.zeros(len(positions))
        kind = self.integers[gap.KIND]
        gap.nearness(positions, surface.quads[faces], surface.gauss[faces], SHAPE, self.reals, kind, nearer)
        chosen, rows = self._chosen, self._rows()
        offsets = np.maximum(0.0, nearer[surface.carriers[chosen, 0]] / surface.areas[chosen])
        change = np.abs(offsets - rows[:, OFFSET]).max(initial=0.0)
        rows[:, OFFSET] = offsets
        return float(change)

    def _forces(self, positions: NDArray[np.float64]) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """Return contact (k, 3), normal (k,), friction forces (k, 3) [N] and slip flags (k,) of the chosen points."""
        count = len(self._chosen)
        forces, shears = np.zeros((count, 3)), np.zeros((count, 3))
        presses, slips = np.zeros(count), np.zeros(count, dtype=np.bool_)
        held_forces.contact_forces(positions, self.reals, self.integers, forces, presses, shears, slips)
        return forces, presses, shears, slips

    def _spread(self, presses: NDArray[np.float64], shears: NDArray[np.float64]) -> Saved:
        """Return normal and friction forces [N] of all points, as stored; they are zero for points not chosen.

        ``presses`` (k,) [N] and ``shears`` (k, 3) [N] are the forces of the chosen points. The returned friction forces
        are in the obstacle's axes.
        """
        press, shear = np.zeros(len(self._scale)), np.zeros((len(self._scale), 3))
        press[self._chosen], shear[self._chosen] = presses, shears @ self._axes
        return {"press": press, "shear": shear}

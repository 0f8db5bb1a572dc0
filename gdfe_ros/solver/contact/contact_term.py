# SPDX-License-Identifier: Apache-2.0
"""Base class of the contact terms: points near a surface, with their contact forces."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.stencil import NO_FACES, NOTHING_NEAR, GapFaces, Stencils, Surfaces, find_stencils
from gdfe_ros.solver.state import Saved, State
from gdfe_ros.solver.terms.term import Term

FAINT = 1e-7
"""Displacement, divided by the body's size, that counts as zero."""
MARGIN = 1e-3
"""A point takes part in a step's complementarity problem if its gap, divided by the body's size, would be below this
after a step at constant forces. Other points that would enter are added in further rounds.
"""
SLIP_MARGIN = 1e-9
"""A point slips if its friction force is below Coulomb's limit by less than this fraction."""

SLIP = 3e-7
"""Slip, divided by the body's size, that the linearisation assumes for a slipping point whose own slip is smaller."""


class ContactTerm(Term):
    """Contact with an obstacle, with a rigid body, or between parts of the body.

    The stored state has an entry for each of all points. ``press`` (p,) [N] is the multiplier l of the normal force,
    and ``shear`` (p, 3) [N] the vector t of the friction force -t. ``slips`` (p,) is 1 if a point slips. ``push`` (p,)
    and ``rub`` (p, 3) [N] are the mean normal and friction forces of the step. Vectors are stored in axes that turn
    with the surface. ``lost`` is the energy that friction has dissipated so far [J].

    Args:
        name: name of the term.
        body: the discretised body.
        count: number p of all points.
        vertices: (v,) vertices on which forces can act.
        friction: Coulomb's coefficient.
        restitution: ratio of the normal speeds of a point after and before an impact.

    Attributes:
        vertices, friction, restitution: the arguments.
        stencils: the near points with their contact forces. Places and axes are as in the last call of `look`. During a
            minimisation, the arrays are views of the field of all contacts (`HeldLoads.field`).
        shape: the touched surface, for the kernels.
        on_body: whether the points of the term belong to the elastic body; False for self-contact.
        faces: the faces (q, 4) that correct gaps, and the areas (q, 4) [m^2] of their Gauss points.
        held_mass: mass [kg] of a rigid body that the elastic body touches, else 0.
        valid: largest relative displacement [m] for which the stencils of the points are valid.
        changed: whether points that press touched other faces after the last call of `follow` than before it.
    """

    on_body, held_mass = False, 0.0
    faces: tuple[NDArray[np.int32], NDArray[np.float64]] = NO_FACES
    ANCHOR: int = 3
    """Count of the numbers of each point that are varied for derivatives: the anchor, where the slip begins; for
    contact with an obstacle or rigid body, also the weights of the material point on which friction acts.
    """
    OTHERS: ClassVar[int] = 0
    """Count of further numbers that are varied for derivatives."""

    def __init__(
        self, name: str, body: Body, count: int, vertices: NDArray[np.int32], *, friction: float, restitution: float
    ) -> None:
        super().__init__(name, np.zeros(self.ANCHOR * count + self.OTHERS), np.zeros(0, np.int32))
        self._body, self.friction, self.restitution = body, friction, restitution
        self.valid, self.changed = np.inf, False
        self.vertices = vertices
        self._chosen, self._led = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        none = np.zeros((count, 3))
        self._free = {
            "press": np.zeros(count),
            "shear": none,
            "slips": np.ones(count),
            "push": np.zeros(count),
            "rub": none,
        }
        self.stencils = NOTHING_NEAR[0]
        self.shape: Surfaces

    @property
    def near(self) -> bool:
        """Whether any point or pair is near a surface that it can touch."""
        return len(self._chosen) > 0

    @property
    def count(self) -> int:
        """Number of points or pairs that are near."""
        return len(self._chosen)

    @property
    def acts(self) -> bool:
        """Whether any point or pair has a contact force."""
        return bool(self.stencils.held[:, 0].any())

    @property
    def delicate(self) -> bool:
        """Whether friction acts on a point or pair that is near."""
        return self.near and self.friction > 0.0

    @property
    def _anchors(self) -> NDArray[np.float64]:
        """The numbers (k, `ANCHOR`) of the near points, a view."""
        return self.reals[: self.ANCHOR * self.count].reshape(-1, self.ANCHOR)

    @property
    def _others(self) -> NDArray[np.float64]:
        return self.reals[len(self.reals) - self.OTHERS :]

    def neutral(self) -> Saved:
        """Return the stored state without contact."""
        return {**self._free, "lost": np.zeros(1)}

    def hold_forces(self, presses: NDArray[np.float64], shears: NDArray[np.float64]) -> Stencils:
        """Return the stencils of the near points, with these forces.

        ``presses`` (k,) and ``shears`` (k, 3) [N] are the normal forces and the vectors t of the friction forces -t.
        The present stencils are reused if they have as many points.
        """
        if len(self.stencils.ends) != self.count:
            width = int(self.shape.own[0]) + 4 * int(self.shape.turning[0])
            self.stencils = Stencils.blank(self.count, width)
        self.stencils.held[:, 0], self.stencils.shears[...] = presses, shears
        return self.stencils

    @abstractmethod
    def lay_out(self, positions: NDArray[np.float64], stencils: Stencils) -> None:
        """Write the ``stencils`` of the near points at ``positions`` (n, 3) [m], except places, axes and forces."""

    def look(self, positions: NDArray[np.float64]) -> None:
        """Update the stencils to ``positions`` (n, 3) [m], for derivatives; the forces turn with the surfaces."""
        if self.near:
            self.lay_out(positions, self.stencils)
            owner = np.zeros(self.count, dtype=np.int64)
            find_stencils(positions, self.shape, GapFaces.join([self.faces]), owner, self.stencils)

    def room(self, positions: NDArray[np.float64]) -> float:
        """Return the distance [m] by which vertices may move from ``positions`` (n, 3) [m] before `follow` is due."""
        return 0.0

    def find_led_motion(self, positions: NDArray[np.float64], before: State) -> NDArray[np.float64]:
        """Return the displacement (k, 3) [m] of the touched surface by commanded poses since the state ``before``."""
        return np.zeros((self.count, 3))

    def finish(self, saved: Saved, positions: NDArray[np.float64]) -> Saved:
        """Return the state to store after a solve that ended at ``positions`` (n, 3) [m] and began with ``saved``.

        The stencils must have been updated to these positions. The state still lacks the mean forces.
        """
        if not self.acts:
            return {**self._free, "lost": saved["lost"]}
        chosen, press, shear = self._chosen, self.stencils.held[:, 0], self.stencils.shears
        slips = ~(press > 0.0)
        slips |= np.linalg.norm(shear, axis=1) >= (1.0 - SLIP_MARGIN) * self.friction * press
        kept = {name: array.copy() for name, array in self._free.items()}
        kept["press"][chosen], kept["slips"][chosen], kept["shear"][chosen] = press, slips, self.to_stored_axes(shear)
        self.keep_places(kept)
        return {**kept, "lost": saved["lost"]}

    @abstractmethod
    def to_stored_axes(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return vectors (k, 3) of the near points in the axes of the stored state."""

    @abstractmethod
    def keep_places(self, kept: Saved) -> None:
        """Write the places where the near points touch to the state ``kept``, which has the forces and slips."""

    def add_multipliers(self, saved: Saved, kept: Saved) -> Saved:
        """Do `add_mean_forces` with the multipliers as mean forces: those of an equilibrium."""
        held, axes, shears = self.stencils.held, self.stencils.axes, self.stencils.shears
        return self.add_mean_forces(saved, kept, held[:, 0] * np.linalg.norm(axes[:, 0], axis=1), -shears)

    def add_mean_forces(
        self, saved: Saved, kept: Saved, pushes: NDArray[np.float64], shears: NDArray[np.float64]
    ) -> Saved:
        """Return the state ``kept`` after a step from ``saved``, with the mean forces on the near points in the step.

        These are the normal forces ``pushes`` (k,) and the friction forces ``shears`` (k, 3) [N].
        """
        slips = kept["slips"][self._chosen] > 0.0
        push, rub = self._free["push"].copy(), self._free["rub"].copy()
        push[self._chosen], rub[self._chosen] = pushes, self.to_stored_axes(shears)
        lost = saved["lost"] - np.einsum("ki,ki->", shears[slips], self.stencils.slips[slips])
        return {**kept, "push": push, "rub": rub, "lost": lost}

    def lead(self, found: Saved, positions: NDArray[np.float64]) -> None:
        """Prepare the linearisation of a solve that ended with the state ``found`` at ``positions`` (n, 3) [m].

        A derivative needs a defined direction of slip. The anchor of each slipping point is therefore moved until the
        slip is parallel to the friction force and at least `SLIP` times the body's size.
        """
        self.look(positions)
        slips, shear, axes = self.stencils.slips, self.stencils.shears, self.shape.frames[0, :9]
        size = np.linalg.norm(shear, axis=1)
        on = (found["slips"][self._chosen] > 0.0) & (size > 0.0)
        far = np.maximum(np.linalg.norm(slips, axis=1), SLIP * self._body.size) / np.where(on, size, 1.0)
        self._led = np.where(on[:, None], far[:, None] * shear - slips, 0.0) @ axes.reshape(3, 3)
        self._anchors[:, :3] -= self._led
        self.look(positions)

    @property
    def multipliers(self) -> NDArray[np.float64]:
        """Normal force l and vector t [N] of each near point, flattened (4 k,)."""
        return np.column_stack([self.stencils.held[:, :1], self.stencils.shears]).ravel()

    @property
    def per_metre(self) -> NDArray[np.float64]:
        """Expected change of each multiplier per metre (4 k,): the body's stiffness [N/m]."""
        return np.repeat(self.stencils.scale, 4)

    def hold(self, multipliers: NDArray[np.float64]) -> None:
        """Set the multipliers (4 k,)."""
        held = multipliers.reshape(-1, 4)
        self.stencils.held[:, 0], self.stencils.shears[...] = held[:, 0], held[:, 1:]

    def updated(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the multipliers (4 k,) after the projections of `complementarity` at ``positions`` (n, 3) [m].

        The projections do not change the multipliers of a solution; they are differentiated for derivatives of solves.
        """
        if not len(self._chosen):
            return np.zeros(0)
        self.look(positions)
        found, scale, held = self.stencils, self.stencils.scale, self.stencils.held[:, 0]
        gaps = found.places[:, 0] + found.soft * held
        press = np.maximum(0.0, held - scale / (1.0 + scale * found.soft) * gaps)
        trial = found.shears + scale[:, None] * found.slips
        size, limit = np.linalg.norm(trial, axis=1), self.friction * press
        share = np.where(size > limit, limit / np.where(size > 0.0, size, 1.0), 1.0)
        return np.column_stack([press, share[:, None] * trial]).ravel()

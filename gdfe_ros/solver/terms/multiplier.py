# SPDX-License-Identifier: Apache-2.0
"""Multipliers of terms: penalties, updates, access to the multipliers of all terms, and Anderson acceleration."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.state import Saved
from gdfe_ros.solver.terms.term import Term
from gdfe_ros.solver.vectors import Array


class UpdatedTerm(Term):
    """Base class of terms whose multipliers are stored in `Term.reals`; solves change them if `updates` is True.

    Attributes:
        own_multipliers: the multipliers, of any shape; a view.
        renew: method that returns the multipliers, in the same shape, after an update at positions (n, 3) [m].
        stored: name of the array with the multipliers in the stored state; further rows may follow the multipliers.
        errors: error of the constraints [m] before each update of a solve.
        size: size of the body [m].
    """

    PATIENCE, FAINT = 6, 1e-5
    """Updates do not settle if, after the first number of them, the error is not smaller than at the first update.
    Errors below the second number times the body's size do not count.
    """
    own_multipliers: Array
    renew: Callable[[Array], Array]
    stored: str
    errors: Sequence[float] = ()
    size = 0.0

    @property
    def wanders(self) -> bool:
        """Whether updates do not settle: they oscillate, or the constraints contradict each other."""
        errors = self.errors
        return len(errors) >= self.PATIENCE and errors[-1] >= max(errors[0], self.FAINT * self.size)

    def resume(self, commands: Mapping[str, float], saved: Saved, found: Saved, positions: Array) -> None:
        """Restore the multipliers at the end of a solve."""
        self.begin(commands, saved, positions, 0.0)
        if self.updates:
            self.own_multipliers[...] = found[self.stored][: len(self.own_multipliers)]

    @property
    def multipliers(self) -> Array:
        """The multipliers (k,), a copy; empty unless `updates` is True."""
        return self.own_multipliers.flatten() if self.updates else np.zeros(0)

    def hold(self, multipliers: Array) -> None:
        """Set the multipliers (k,)."""
        if self.updates:
            self.own_multipliers[...] = multipliers.reshape(self.own_multipliers.shape)

    def updated(self, positions: Array) -> Array:
        """Return the multipliers (k,) after an update at ``positions`` (n, 3) [m]; empty unless `updates` is True."""
        return self.renew(positions).flatten() if self.updates else np.zeros(0)


EFFORT, TARGET, STIFFNESS = range(3)
"""First offsets in ``reals`` of an `EffortTerm`: the effort, the commanded length [m] or volume [m^3], and the penalty
[N/m] or [Pa/m^3].
"""


class EffortTerm(UpdatedTerm):
    """A term with one effort, a tension [N] or pressure [Pa]: commanded, or the multiplier of a length or volume."""

    PENALTY = 10.0
    """Penalty stiffness of a commanded length or volume, divided by the body's stiffness against a change of this
    length or volume. The constant matrix gives this stiffness. The ratio is large enough for few updates. It is small
    enough to cause only one outlying eigenvalue, which the history of a minimisation resolves.
    """
    stored = "effort"

    def fit_penalty(self, matrix: ConstantMatrix, force: Array) -> None:
        """Set the penalty of a term that acts on the vertices with ``force`` (n, 3) at unit tension or pressure.

        Raises:
            ValueError: the term moves nothing; scenes with such an actuator are rejected on loading.
        """
        compliance = matrix.compliance(force)
        if not compliance > 0.0:
            raise ValueError(f"actuator {self.name!r} moves nothing: everything that it acts on is held by handles")
        self.reals[STIFFNESS] = self.PENALTY / compliance

    @property
    def own_multipliers(self) -> Array:
        """The effort (1,), a view."""
        return self.reals[EFFORT : EFFORT + 1]

    @property
    def area(self) -> float:
        """Order of magnitude of the change of the length or volume per 1 m of displacement: 1 for a length."""
        return 1.0

    @property
    def per_metre(self) -> Array:
        """The penalty times the `area` (1,); empty without a constraint."""
        return np.full(self.multipliers.shape, self.reals[STIFFNESS] * self.area)

    def update(self, positions: Array) -> float:
        """Update the effort that keeps the length or volume; return the error as a displacement [m]."""
        before = self.reals[EFFORT]
        (self.reals[EFFORT],) = self.renew(positions)
        return float(abs(self.reals[EFFORT] - before) / (self.reals[STIFFNESS] * self.area))

    def guess_effort(self, saved: Saved, ratio: float) -> float:
        """Return the initial effort of a solve: the last one plus ``ratio`` times the last change."""
        last, before = saved["effort"]
        return float(last + ratio * (last - before))

    def neutral(self) -> Saved:
        """Return the stored state without effort."""
        return {"effort": np.zeros(2)}

    def finish(self, saved: Saved, positions: Array) -> Saved:
        """Return the state to store: the present effort, and the effort of the step before."""
        return {"effort": np.array([self.reals[EFFORT], saved["effort"][0] if saved else 0.0])}


class Multipliers:
    """The multipliers (k,) of all terms, one after another.

    Args:
        terms: the terms of a converged solve.

    Attributes:
        per_metre: (k,) order of magnitude of each multiplier's change per 1 m of displacement.
    """

    def __init__(self, terms: Sequence[Term]) -> None:
        self._terms = terms
        self._ends = np.cumsum([len(term.multipliers) for term in terms])[:-1]
        self.per_metre = self._join(lambda term: term.per_metre)

    def collect_multipliers(self) -> Array:
        """Return the present multipliers (k,)."""
        return self._join(lambda term: term.multipliers)

    def hold(self, values: Array) -> None:
        """Set the multipliers (k,)."""
        for term, part in zip(self._terms, np.split(values, self._ends) if self._terms else [], strict=True):
            term.hold(part)

    def updated(self, positions: Array) -> Array:
        """Return the multipliers (k,) after an update at positions (n, 3) [m]; the terms are not modified."""
        return self._join(lambda term: term.updated(positions))

    def metres(self, values: Array) -> float:
        """Return the largest displacement [m] that corresponds to a change ``values`` (k,) of the multipliers."""
        return float(np.abs(values / self.per_metre).max(initial=0.0))

    def _join(self, part: Callable[[Term], Array]) -> Array:
        return np.concatenate([np.zeros(0), *(part(term) for term in self._terms)])


class Anderson:
    """Anderson acceleration of the iteration x <- x + f(x), from the last few pairs (x, f).

    It is of type II (Anderson 1965), with restarts.

    Args:
        growth: largest factor by which the norm of the residual may grow before the history is dropped. A large factor
            suits iterations that diverge without acceleration.
    """

    MEMORY = 6
    """Number of differences between successive iterates that the acceleration uses."""
    GROWTH = 2.0
    """If the norm of the residual grows by more than this factor, the history is dropped and a plain iteration follows.
    """

    def __init__(self, growth: float = GROWTH) -> None:
        self._growth = growth
        self._iterates: list[Array] = []
        self._residuals: list[Array] = []

    def next(self, x: Array, f: Array) -> Array:
        """Return the iterate that follows ``x`` with the residual ``f``; all are flat (k,).

        If the norm of the residual has grown by more than ``growth``, the history is dropped and x + f is returned.
        """
        if self._residuals and np.linalg.norm(f) > self._growth * np.linalg.norm(self._residuals[-1]):
            self._iterates.clear()
            self._residuals.clear()
        self._iterates.append(x.copy())
        self._residuals.append(f.copy())
        del self._iterates[: -self.MEMORY - 1], self._residuals[: -self.MEMORY - 1]
        if len(self._residuals) == 1:
            return x + f
        changes = np.diff(np.array(self._residuals), axis=0)
        moves = np.diff(np.array(self._iterates), axis=0)
        # Solve the small normal equations: an SVD of the tall system costs more than the rest of the iteration.
        weights = np.linalg.lstsq(changes @ changes.T, changes @ f, rcond=1e-14)[0]
        return x + f - weights @ (moves + changes)

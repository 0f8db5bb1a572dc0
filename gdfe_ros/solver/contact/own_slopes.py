# SPDX-License-Identifier: Apache-2.0
"""Self-contact for derivatives: each pair of a converged solve keeps its face, and continues to stick or to slip."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints.obstacle import SelfContact
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact import held_pairs as pair
from gdfe_ros.solver.contact.contact import SLIP
from gdfe_ros.solver.contact.own_contact import REACH, OwnContact
from gdfe_ros.solver.contact.own_surface import DEPTH, Nearest
from gdfe_ros.solver.contact.pair_touch import frames, tangential
from gdfe_ros.solver.state import Saved

HELD = [*range(pair.PRESS, pair.OFFSET), pair.SUPPORT]
"""Columns of a pair's row that an update changes."""
WIDTH = len(HELD) + 3
"""Number of multipliers of a pair: the columns `HELD`, and the three components of the change of its offset."""


class DifferentiableOwnContact(OwnContact):
    """Self-contact that can be linearised at a converged solve. The pairs then keep their faces.

    The multipliers of a pair are, in this order: its normal force, its normal, the weights of its face's corners, its
    friction force, its support, and the change of its offset.
    """

    def __init__(self, meant: SelfContact, body: Body) -> None:
        super().__init__(meant, body)
        self.reals = np.concatenate([self.reals, np.zeros(3 * self.pairs.count)])

    def resume(self, commands: Mapping[str, float], saved: Saved, found: Saved, positions: NDArray[np.float64]) -> None:
        """Prepare the linearisation of a solve: choose the pairs that press at its end, with their forces.

        The direction of slip must be defined. A slipping pair that has hardly moved therefore gets a slip of `SLIP`
        times the body's size in the direction of its friction force.
        """
        if not found["press"].any():
            self._chosen = self._face = np.zeros(0, dtype=np.int64)
            self._weights, self.integers[pair.COUNT] = np.zeros((0, 4)), 0
            return
        x = self.points.at(positions)
        near = self.pairs.look(x, x, REACH * self._body.size, found["face"].astype(np.int64))
        near.face[~(found["press"] > 0.0)] = -1
        on = near.face >= 0
        axes = frames(x, self.pairs.carriers(np.flatnonzero(on), found["face"][on].astype(np.int64)))
        self._press, self._normal, self._shear = found["press"].copy(), found["normal"], np.zeros_like(found["shear"])
        self._shear[on] = np.einsum("kij,kj->ki", axes, found["shear"][on])
        self._from = self.points.at(self._last.positions)
        self._pack(near, x)
        self._moved()[...] = 0.0
        self._slips = found["slips"][self._chosen] > 0.0
        self._set_anchors(x)

    def vary(self, commands: Mapping[str, float], saved: Saved, positions: NDArray[np.float64]) -> None:
        """Update the anchors of the chosen pairs; keep the choice of pairs."""
        if not self.near:
            return
        self._from, rows = self.points.at(self._last.positions), self._rows()
        rows[:, pair.OFFSET : pair.SUPPORT] = self._ends + self._slid(rows) - self._anchors

    @property
    def multipliers(self) -> NDArray[np.float64]:
        """The multipliers of all chosen pairs (`WIDTH` k,)."""
        return np.hstack([self._rows()[:, HELD], self._moved()]).ravel()

    @property
    def per_metre(self) -> NDArray[np.float64]:
        """Expected change of each multiplier per metre (`WIDTH` k,).

        It is the penalty [N/m] for forces, 1 / shortest edge for normals and weights, 1 / rim for supports, and 1 for
        offsets.
        """
        topology, rows = self.surface.topology, self._rows()
        scales = np.full((len(rows), pair.STRIDE), DEPTH / topology.depth)
        scales[:, pair.PRESS] = rows[:, pair.SCALE]
        scales[:, pair.SHEAR : pair.OFFSET] = rows[:, pair.SCALE, None]
        scales[:, pair.SUPPORT] = 1.0 / topology.rim
        return np.hstack([scales[:, HELD], np.ones((len(rows), 3))]).ravel()

    def hold(self, multipliers: NDArray[np.float64]) -> None:
        """Set the multipliers (`WIDTH` k,)."""
        rows, given = self._rows(), multipliers.reshape(-1, WIDTH)
        if not len(rows):
            return
        rows[:, HELD] = given[:, : len(HELD)]
        rows[:, pair.OFFSET : pair.SUPPORT] += given[:, len(HELD) :] - self._moved()
        self._moved()[...] = given[:, len(HELD) :]

    def updated(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the multipliers (`WIDTH` k,) after one plain update; the term's own multipliers stay unchanged."""
        held = self.multipliers
        if not len(held):
            return held
        pair.project_pairs(positions, self.reals, self.integers)
        x = self.points.at(positions)
        found, near = self._rows().copy(), self._nearest(x, self._face)
        self.hold(held)
        on = near.face >= 0  # a vertex that leaves its face sideways keeps its normal
        found[on, pair.NORMAL : pair.WEIGHTS], found[on, pair.WEIGHTS : pair.SHEAR] = near.normal[on], near.weights[on]
        found[on, pair.SUPPORT] = near.support[on]
        shears, normals = found[:, pair.SHEAR : pair.OFFSET], found[:, pair.NORMAL : pair.WEIGHTS]
        found[:, pair.SHEAR : pair.OFFSET] = tangential(shears, normals)
        return np.hstack([found[:, HELD], self._slid(found) - self._anchors]).ravel()

    def _nearest(self, x: NDArray[np.float64], face: NDArray[np.int64]) -> Nearest:
        """Return the nearest points on the given faces ``face`` (k,) to the vertices of the chosen pairs."""
        return self.pairs.nearest_to(x, self._chosen, face).of(self._chosen)

    def _slid(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the tangential vectors (k, 3) [m] from face points to vertices in the last state.

        The face points have the corner weights of ``rows``.
        """
        before = self._before(self._chosen, self._face, rows[:, pair.WEIGHTS : pair.SHEAR])
        return tangential(before, rows[:, pair.NORMAL : pair.WEIGHTS])

    def _set_anchors(self, x: NDArray[np.float64]) -> None:
        """Set the offsets at the points ``x`` (n + p, 3) [m].

        The slip of a slipping pair has the direction of the friction force. Its length is the length in the solve, but
        at least `SLIP` times the body's size.
        """
        rows, slips, corners = self._rows(), self._slips, self.pairs.carriers(self._chosen, self._face)
        self._anchors = self._slid(rows)
        away = x[self.pairs.first[self._chosen]] - np.einsum("ka,kai->ki", self._weights, x[corners])
        slid = tangential(away - self._anchors, rows[:, pair.NORMAL : pair.WEIGHTS])
        shears = rows[:, pair.SHEAR : pair.OFFSET]
        length = np.linalg.norm(shears, axis=1)[:, None]
        far = np.maximum(np.linalg.norm(slid, axis=1), SLIP * self._body.size)[:, None]
        ends = away - far * shears / np.where(length > 0.0, length, 1.0)
        rows[slips, pair.OFFSET : pair.SUPPORT] = ends[slips]
        self._ends = rows[:, pair.OFFSET : pair.SUPPORT].copy()

    def _moved(self) -> NDArray[np.float64]:
        """Return the changes (k, 3) [m] of the offsets, a view; they are stored after the rows of all pairs."""
        return self.reals[-3 * self.pairs.count :][: 3 * len(self._chosen)].reshape(-1, 3)

# SPDX-License-Identifier: Apache-2.0
"""Mass and inertia of a body, and inertia as a term: E = k/2 |x - x_hat|_M^2.

At the minimum of the sum of all terms, the equation of motion is satisfied. The mass matrix is consistent with the
displacements of the cells, and the same for x, y and z.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np
from numpy import uint64
from numpy.typing import NDArray
from scipy import sparse

from gdfe_ros.actuators.load import AttachedMass, gauss_points
from gdfe_ros.compiled import kernel
from gdfe_ros.mesh.cells.filling import Filling
from gdfe_ros.mesh.triples import corner, cross, dot
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.matrix.constant_matrix import scatter
from gdfe_ros.solver.motion.scheme import Kinematics, Rule, stiffness
from gdfe_ros.solver.settings import Dynamics
from gdfe_ros.solver.state import Saved
from gdfe_ros.solver.terms.term import Term, as_arrays, term_kernel
from gdfe_ros.solver.vectors import Array
from gdfe_ros.sparse_lu import LuFactor


def mass_matrix(
    rest: Array,
    cells: NDArray[np.int32],
    density: Array,
    attached: Sequence[AttachedMass] = (),
    *,
    filling: Filling | None = None,
) -> sparse.csr_matrix:
    """Return the mass matrix M_ab = sum_e rho_e int N_a N_b dV (n, n) [kg], plus m N_a N_b of each attached mass m.

    With a lumped matrix, the polar moment of a section two cells across would be 1.5 times too large.

    Args:
        rest: (n, 3) rest vertices [m].
        cells: (m, c) vertices of the cells.
        density: (m,) densities of the cells [kg/m^3].
        attached: masses on material points.
        filling: filled fraction of cut cells.
    """
    blocks = np.zeros((len(cells), cells.shape[1], cells.shape[1]))
    for volume, shape in gauss_points(rest, cells, filling):
        blocks += (density * volume)[:, None, None] * (shape[:, :, None] * shape[:, None, :])
    matrix = scatter(blocks, cells, len(rest)).tocsr()
    for item in attached:
        weights = item.points.weights
        blocks = item.part * weights[:, :, None] * weights[:, None, :]
        matrix += scatter(blocks, item.points.corners, len(rest)).tocsr()
    return matrix


class FreeMass:
    """Inverse mass matrix of the free vertices and the rigid bodies; the mass matrix is factored on first use.

    Args:
        body: the discretised body.
        mass: (n, n) its mass matrix [kg].
    """

    def __init__(self, body: Body, mass: sparse.csr_matrix) -> None:
        rigid = [each.vertices for each in body.rigid_bodies]
        free, self._mass = np.concatenate([body.unknowns.free, *rigid]), mass
        moves = np.ones((len(free), 3), dtype=bool)
        moves.reshape(-1)[body.unknowns.fixed] = False
        self._free = [free[along] for along in moves.T]
        self._rigid = np.array(rigid, dtype=np.int32).reshape(-1, 4)
        self._of_rigid = mass.diagonal()[self._rigid[:, 0]]
        self._place, self._known = np.full(len(body.rest), -1, dtype=np.int64), np.zeros(0, dtype=np.int64)
        self._between, self._columns = np.zeros((0, 0)), {}

    @cached_property
    def _parts(self) -> list[tuple[NDArray[np.int64], NDArray[np.intp], LuFactor]]:
        """Groups of axes with equal free vertices: the axes, these vertices, and the factor of their mass matrix."""
        alike = all(np.array_equal(free, self._free[0]) for free in self._free)  # no rollers, or alike in x, y and z
        each = np.arange(3).reshape((1, 3) if alike else (3, 1))
        freed = [self._free[axes[0]] for axes in each]
        return [
            (axes, free, LuFactor(self._mass[free][:, free].tocsc())) for axes, free in zip(each, freed, strict=True)
        ]

    def accelerate(self, forces: Array) -> Array:
        """Return the acceleration (n, 3) [m/s^2] of free vertices and rigid bodies by forces (n, 3) [N].

        Rows of all other vertices are zero.
        """
        acceleration = np.zeros_like(forces)
        for axes, free, factor in self._parts:
            own = free if len(axes) == 3 else np.ix_(free, axes)
            acceleration[own] = factor.solve(forces[own])
        return acceleration

    def respond(self, positions: Array, forces: Array) -> Array:
        """Do `accelerate` by columns of the inverse mass matrix, for ``forces`` (n, 3) [N] on included vertices only.

        Accelerations of rigid bodies are rigid motions at ``positions`` (n, 3) [m].
        """
        acceleration = np.zeros_like(forces)
        for axes, free, _ in self._parts:
            spread(self._columns[axes[0]], self._place, free, axes, forces, acceleration)
        if len(self._rigid):
            acceleration[self._rigid] = rigid_part(positions[self._rigid], acceleration[self._rigid])
        return acceleration

    def inverse(self, positions: Array) -> tuple[NDArray[np.int64], Array]:
        """Return the place (n,) of each vertex in a part of the inverse mass matrix, and this part (3 m, 3 m) [1/kg].

        The part contains the included vertices. Rigid bodies move as rigid bodies at ``positions`` (n, 3) [m]; of a
        rigid body, either all four vertices are included or none. The caller must not modify the results.
        """
        write_rigid(positions, self._rigid, self._of_rigid, self._place, self._between)
        return self._place, self._between

    def include(self, vertices: NDArray[np.int32]) -> None:
        """Extend the known part of the inverse mass matrix to ``vertices`` (any shape), a column for each new one."""
        missing = vertices[self._place[vertices] < 0]
        if not len(missing):
            return
        new = np.unique(missing)
        self._known = np.concatenate([self._known, new])
        count = len(self._known)
        self._place[self._known], found = np.arange(count), np.zeros((count, 3, count, 3))
        for axes, free, factor in self._parts:
            row, none = np.full(len(self._place), len(free)), np.zeros((0, len(free) + 1))
            row[free] = np.arange(len(free))  # the last column is that of vertices that are not free
            right = np.zeros((len(new), len(free) + 1))
            right[np.arange(len(new)), row[new]] = 1.0
            # One at a time: otherwise the last bits of a column would depend on the columns computed together with it.
            columns = np.array([np.append(factor.solve(each), 0.0) for each in right[:, :-1]])
            self._columns[axes[0]] = columns = np.concatenate([self._columns.get(axes[0], none), columns])
            soft = columns[:, row[self._known]]
            for axis in axes:
                found[:, axis, :, axis] = 0.5 * (soft + soft.T)
        self._between = found.reshape(3 * count, 3 * count)


@kernel
def spread(columns, place, free, axes, forces, out):
    """Write the acceleration of ``free`` vertices (f,) by ``forces`` (n, 3) [N] along ``axes`` to ``out`` (n, 3).

    The column of each vertex in the inverse mass matrix is the row ``place`` (n,) of ``columns``. Forces on vertices
    whose place is -1 do not count.
    """
    found = np.zeros((len(axes), len(free)))
    for v in range(len(place)):
        for a in range(len(axes) if place[v] >= 0 else 0):
            force, column = forces[v, axes[a]], columns[place[v]]
            for i in range(len(free) if force != 0.0 else 0):
                found[a, i] += column[i] * force
    for a in range(len(axes)):
        for i in range(len(free)):
            out[free[i], axes[a]] = found[a, i]


@kernel
def rigid_part(positions, vectors):
    """Return the rigid fields u + w x r (k, 4, 3) closest to ``vectors`` (k, 4, 3) on four vertices of equal mass each.

    The vertices are at ``positions`` (k, 4, 3) [m]. If ``vectors`` are velocities, the rigid field has the same
    momentum and angular momentum. If ``vectors`` are forces divided by the mass of a vertex, the rigid field is the
    acceleration of the rigid body.
    """
    found, arms, mean, inertia, moment = np.empty_like(vectors), np.empty((4, 3)), np.empty(3), np.eye(3), np.empty(3)
    for k in range(len(vectors)):
        inertia[:], moment[:] = 0.0, 0.0
        for j in range(3):
            middle = 0.25 * (positions[k, 0, j] + positions[k, 1, j] + positions[k, 2, j] + positions[k, 3, j])
            mean[j] = 0.25 * (vectors[k, 0, j] + vectors[k, 1, j] + vectors[k, 2, j] + vectors[k, 3, j])
            for a in range(4):
                arms[a, j] = positions[k, a, j] - middle
        for a in range(4):
            arm = corner(arms, a)
            square, turned = dot(arm, arm), cross(arm, corner(vectors[k], a))
            for i in range(3):
                moment[i] += turned[i]
                inertia[i, i] += square
                for j in range(3):
                    inertia[i, j] -= arm[i] * arm[j]
        spin = np.linalg.solve(inertia, moment)
        for a in range(4):
            turned = cross((spin[0], spin[1], spin[2]), corner(arms, a))
            for j in range(3):
                found[k, a, j] = mean[j] + turned[j]
    return found


@kernel
def write_rigid(positions, rigid, masses, place, between):
    """Write the entries of ``between``, see `FreeMass.inverse`, of all bodies in ``rigid`` (b, 4) that have a place.

    ``masses`` (b,) [kg] are the masses of one vertex of each body.
    """
    unit, four = np.zeros((1, 4, 3)), np.empty((1, 4, 3))
    for k in range(len(rigid)):
        for a in range(4):
            four[0, a] = positions[rigid[k, a]]
        for row in range(12 if place[rigid[k, 0]] >= 0 else 0):
            a, i = row // 3, row % 3
            unit[0, a, i] = 1.0
            moved = rigid_part(four, unit)[0]
            unit[0, a, i] = 0.0
            entries = between[3 * place[rigid[k, a]] + i]
            for b in range(4):
                for j in range(3):
                    entries[3 * place[rigid[k, b]] + j] = moved[b, j] / masses[k]


NAME = "(inertia)"
"""Name of the term; no actuator or load of a scene can have it."""


@kernel
def inertia_energy(x, reals, integers, force, size):
    """Return k/2 d^T M d [J] with d = x - x_hat, with the signature required by `term_kernel`.

    ``reals`` are k [1/s^2], x_hat (n, 3) [m] and the entries of M [kg]. ``integers`` are row starts and columns of M.
    """
    count, k = len(x), reals[0]
    if k == 0.0:
        return 0.0
    away = x - reals[1 : 3 * count + 1].reshape(count, 3)
    entries, columns = reals[3 * count + 1 :], integers[count + 1 :]
    energy = 0.0
    for v in range(count):
        f0, f1, f2 = 0.0, 0.0, 0.0
        for i in range(integers[v], integers[v + 1]):
            mass, w = entries[i], uint64(columns[i])
            f0 += mass * away[w, 0]
            f1 += mass * away[w, 1]
            f2 += mass * away[w, 2]
        f0, f1, f2 = k * f0, k * f1, k * f2
        energy += 0.5 * (f0 * away[v, 0] + f1 * away[v, 1] + f2 * away[v, 2])
        force[v, 0] += f0
        force[v, 1] += f1
        force[v, 2] += f2
    size[0] += energy
    return energy


@term_kernel
def _entry(x, n, reals, k, integers, i, force, size):
    return inertia_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


class Inertia(Term):
    """Inertia of a body in steps of one length, with damping relative to the world.

    Args:
        body: the discretised body.
        mass: (n, n) its mass matrix [kg].
        dynamics: time integration scheme and damping.
        h: length of a step [s].
    """

    kernel, even = _entry, True

    def __init__(self, body: Body, mass: sparse.csr_matrix, dynamics: Dynamics, h: float) -> None:
        self._mass, self._dynamics, self._h, self._rest = mass, dynamics, h, body.rest
        kappa, theta = stiffness(dynamics, h)
        self._factor = kappa + dynamics.damping.mass * theta
        self._driven = np.zeros((len(body.rest), 3), dtype=bool)
        for handle in body.handles:
            if handle.slide is not None:
                self._driven[handle.vertices] = ~handle.slide
            elif not handle.turning:
                self._driven[np.ix_(handle.vertices, [axis for axis in range(3) if axis not in handle.free])] = True
        rigid = [each.vertices for each in body.rigid_bodies]
        self._rigid = np.array(rigid, dtype=np.int32).reshape(-1, 4)
        self._rule: Rule | None = None
        numbers = np.concatenate([np.zeros(1 + 3 * len(body.rest)), mass.data])
        super().__init__(NAME, numbers, np.concatenate([mass.indptr, mass.indices]).astype(np.int32))

    def stiffness(self) -> sparse.spmatrix:
        """Return the term's stiffness: kappa M plus the damping relative to the world."""
        return (self._factor * self._mass).tocsc()

    def couplings(self) -> NDArray[np.int32]:
        """Return the vertices (r, 4) of rigid bodies, which no element couples."""
        return self._rigid

    def tangents(self, positions: Array) -> Array:
        """Return zeros (r, 12, 12); the whole tangent is in `stiffness`."""
        return np.zeros((len(self._rigid), 12, 12))

    def neutral(self) -> Saved:
        """Return the stored state before the first step."""
        none = np.zeros_like(self._rest)
        return Kinematics.start(self._rest, none, none, 0.0).saved

    def begin(self, commands: Mapping[str, float], saved: Saved, positions: Array, ratio: float) -> None:
        """Prepare a step; ``positions`` (n, 3) [m] have the handles at their targets.

        Before the motion has started there is no inertia. Driven vertices of handles get the velocity of their
        displacement in this step. Otherwise the scheme would continue a jump of their velocity as an endless
        oscillation.
        """
        if not saved["h"][0]:
            self.reals[0] = 0.0
            return
        now, damping = Kinematics.of(saved), self._dynamics.damping.mass
        rule = Rule.of(self._dynamics, self._h, now)
        velocity, acceleration = self._follow(positions, now)
        factor = rule.kappa + damping * rule.theta
        resisted = rule.kappa * rule.x_hat + damping * (rule.theta * rule.drift - rule.lag)
        driven = factor * positions - acceleration - damping * velocity
        self.reals[0] = factor
        x_hat = self.reals[1 : 1 + positions.size].reshape(-1, 3)
        x_hat[...] = np.where(self._driven, driven, resisted) / factor
        self._rule = rule

    def finish(self, saved: Saved, positions: Array) -> Saved:
        """Return the state to store: the kinematics at ``positions`` (n, 3) [m]."""
        now, rule = Kinematics.of(saved), self._rule
        velocity, acceleration = rule.velocity(positions), rule.acceleration(positions)
        if len(self._rigid):  # differences of rotated positions stretch a little; undamped schemes would keep that
            velocity[self._rigid] = rigid_part(positions[self._rigid], velocity[self._rigid])
        given, change = self._follow(positions, now)
        after = Kinematics(
            positions=positions,
            velocity=np.where(self._driven, given, velocity),
            acceleration=np.where(self._driven, change, acceleration),
            balanced=np.where(self._driven, change, rule.find_force(positions)),
            before=now.positions,
            velocity_before=now.velocity,
            pushed=np.zeros_like(velocity),
            h=self._h,
        )
        return after.saved

    def energy(self, positions: Array) -> float:
        """Return 0: the energy of inertia is kinetic."""
        return 0.0

    def _follow(self, positions: Array, now: Kinematics) -> tuple[Array, Array]:
        """Return velocity [m/s] and acceleration [m/s^2] (n, 3) of driven vertices, as backward differences."""
        given = (positions - now.positions) / self._h
        return given, (given - now.velocity) / self._h

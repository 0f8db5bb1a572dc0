# SPDX-License-Identifier: Apache-2.0
"""Viscosity and relaxation as one term in Green strains. The term does not resist rigid motions at any rate.

A hexahedron has the strains E = (F^T F - 1)/2, with its mean deformation gradient F, and w_k = F^T q_k, with its
hourglass vectors q_k. The w_k measure bending. Neither E nor w_k changes if the body rotates. A tetrahedron has the
strains E of its four integration points instead, each with its part of the volume. A dashpot, and each branch of a
Prony series, contributes k/2 |E - E_hat|^2 V with a strain E_hat that follows from the previous steps. The sum of these
energies has the same form.

In the kernels, it is sum_i k_i/2 (e_i - e_hat_i)^2 over strains e that do not depend on rotations of the body. The
tangent is the Gauss-Newton part sum_i k_i de_i/dx de_i/dx^T of the second derivative, which is positive semi-definite.

A body consists of places: hexahedra, or integration points of tetrahedra. Each place has c corners and 4 or no
hourglass vectors (modes). The row of a place in the term's reals has two stiffnesses, the strains E_hat and w_hat_k,
the gradients (c, 3) and the hourglass operators (modes, c). The term's integers are c, the number of modes, and the
corners of all places.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy import uint64
from numpy.typing import NDArray
from scipy import sparse

from gdfe_ros.compiled import inlined, kernel, vector_kernel
from gdfe_ros.materials.table import SHEAR
from gdfe_ros.mesh.cells.tet_operators import TetOperators, gradients
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.matrix.constant_matrix import assemble
from gdfe_ros.solver.settings import Dynamics
from gdfe_ros.solver.state import Saved, State
from gdfe_ros.solver.terms.term import Term, as_arrays, term_kernel
from gdfe_ros.solver.vectors import Array

GREEN = 6
"""Number of strains of E; each hourglass vector adds three."""


@inlined
def places(reals, integers, count, modes):
    """Return the rows of all places with ``count`` corners, and the corners (p, c)."""
    width = 2 + GREEN + 3 * modes + (3 + modes) * count
    return reals.reshape(len(reals) // width, width), integers[2:].reshape(-1, count)


@inlined
def parts(row, count, modes):
    """Return the strains (6 + 3 modes,), gradients (c, 3) and hourglass operators (modes, c) of a place's row."""
    first = 2 + GREEN + 3 * modes
    last = first + 3 * count
    return row[2:first], row[first:last].reshape(count, 3), row[last:].reshape(modes, count)


@inlined
def measure(x, corners, count, modes, gradient, hourglass, f, q, strain):
    """Write F (3, 3), the q_k (modes, 3), and E (xx, yy, zz, xy, yz, zx) and w_k of a place at ``x`` (n, 3) [m]."""
    f[...], q[...] = 0.0, 0.0
    for a in range(count):
        for r in range(3):
            y = x[corners[a], r]
            for i in range(3):
                f[r, i] += y * gradient[a, i]
            for k in range(modes):
                q[k, r] += y * hourglass[k, a]
    for i in range(3):
        j = (i + 1) % 3
        strain[i] = 0.5 * (f[0, i] * f[0, i] + f[1, i] * f[1, i] + f[2, i] * f[2, i] - 1.0)
        strain[3 + i] = 0.5 * (f[0, i] * f[0, j] + f[1, i] * f[1, j] + f[2, i] * f[2, j])
        for k in range(modes):
            strain[GREEN + 3 * k + i] = f[0, i] * q[k, 0] + f[1, i] * q[k, 1] + f[2, i] * q[k, 2]


@inlined
def energy_of(x, reals, integers, count, modes, force, size):
    """Do `viscous_energy` for places with ``count`` corners."""
    rows, cells = places(reals, integers, count, modes)
    f, q, pull, back = np.empty((3, 3)), np.empty((modes, 3)), np.empty((3, 3)), np.empty((modes, 3))
    energy, stress = 0.0, np.empty(GREEN + 3 * modes)
    for p in range(len(rows)):
        aim, gradient, hourglass = parts(rows[p], count, modes)
        measure(x, cells[p], count, modes, gradient, hourglass, f, q, stress)
        for i in range(len(stress)):
            off, weight = stress[i] - aim[i], rows[p, 0] if i < GREEN else rows[p, 1]
            stress[i] = weight * off
            energy += (1.0 if 3 <= i < GREEN else 0.5) * weight * off * off
        for r in range(3):
            for i in range(3):
                j, m = (i + 1) % 3, (i + 2) % 3
                pull[r, i] = f[r, i] * stress[i] + f[r, j] * stress[3 + i] + f[r, m] * stress[3 + m]
            for k in range(modes):
                at = GREEN + 3 * k
                back[k, r] = f[r, 0] * stress[at] + f[r, 1] * stress[at + 1] + f[r, 2] * stress[at + 2]
                for i in range(3):
                    pull[r, i] += q[k, r] * stress[at + i]
        for a in range(count):
            for r in range(3):
                total = pull[r, 0] * gradient[a, 0] + pull[r, 1] * gradient[a, 1] + pull[r, 2] * gradient[a, 2]
                for k in range(modes):
                    total += back[k, r] * hourglass[k, a]
                force[cells[p, a], r] += total
    size[0] += energy
    return energy


@kernel
def viscous_energy(x, reals, integers, force, size):
    """Return sum_p K/2 |E - E_hat|^2 + C/2 sum_k |w_k - w_hat_k|^2 [J], with the signature of `term_kernel`."""
    if integers[1] == 4:  # with these constants, loops are unrolled
        return energy_of(x, reals, integers, 8, 4, force, size)
    return energy_of(x, reals, integers, 10, 0, force, size)


@term_kernel
def viscous_entry(x, n, reals, k, integers, i, force, size):
    """Call `viscous_energy` with the raw pointers that the terms' kernels receive."""
    return viscous_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


@kernel
def all_strains(x, reals, integers, out):
    """Write E and w_k (p, 6 + 3 modes) of all places at positions ``x`` (n, 3) [m]."""
    count, modes = integers[0], integers[1]
    rows, cells = places(reals, integers, count, modes)
    f, q = np.empty((3, 3)), np.empty((modes, 3))
    for p in range(len(rows)):
        _, gradient, hourglass = parts(rows[p], count, modes)
        measure(x, cells[p], count, modes, gradient, hourglass, f, q, out[p])


@kernel
def square(strains, volume, bend):
    """Return |E|^2 V + b sum_k |w_k|^2 (p,) of ``strains`` (p, 6 + 3 modes); V is ``volume``, b is ``bend`` (p,)."""
    found = np.zeros(len(strains))
    for p in range(len(strains)):
        for i in range(strains.shape[1]):
            weight = bend[p] if i >= GREEN else volume[p] if i < 3 else 2.0 * volume[p]
            found[p] += weight * strains[p, i] * strains[p, i]
    return found


@kernel
def viscous_tangents(x, reals, integers, out):
    """Write the tangents (m, 3 c, 3 c) [N/m] of elements at positions ``x`` (n, 3) [m], summed over their places."""
    count, modes = integers[0], integers[1]
    rows, cells = places(reals, integers, count, modes)
    f, q, strain, each = np.empty((3, 3)), np.empty((modes, 3)), np.empty(GREEN + 3 * modes), len(rows) // len(out)
    slope = np.empty((each * len(strain), out.shape[1]))
    for p in range(len(rows)):
        _, gradient, hourglass = parts(rows[p], count, modes)
        measure(x, cells[p], count, modes, gradient, hourglass, f, q, strain)
        own = slope[(p % each) * len(strain) : (p % each + 1) * len(strain)]
        for a in range(count):
            for r in range(3):
                for i in range(3):
                    j = (i + 1) % 3
                    own[i, 3 * a + r] = f[r, i] * gradient[a, i]
                    own[3 + i, 3 * a + r] = 0.5 * (f[r, i] * gradient[a, j] + f[r, j] * gradient[a, i])
                    for k in range(modes):
                        own[GREEN + 3 * k + i, 3 * a + r] = gradient[a, i] * q[k, r] + f[r, i] * hourglass[k, a]
        for i in range(len(strain)):
            own[i] *= np.sqrt(rows[p, 0] if i < 3 else 2.0 * rows[p, 0] if i < GREEN else rows[p, 1])
        if p % each == each - 1:
            squares(slope, out[p // each])


@vector_kernel
def squares(slope, out):
    """Write S^T S (c, c) of ``slope`` S (s, c) to ``out``."""
    out[...] = 0.0
    for i in range(len(slope)):
        row = slope[i]
        for a in range(len(row)):
            weight = row[a]
            for b in range(uint64(len(row))):
                out[a, b] += weight * row[b]


NAME = "(viscosity)"
"""Name of the term; no actuator or load of a scene can have it."""


class Viscosity(Term):
    """Dashpot and Prony branches of a body in steps of one length.

    A dashpot of viscosity eta has the stress eta dE/dt with the backward difference of second order, dE/dt = 3/(2 h) (E
    - (4 E_n - E_(n-1))/3). A branch of modulus m and relaxation time tau has the stress m (E - V), with the viscous
    strain V from dV/dt = (E - V)/tau by the trapezoidal rule.

    Args:
        body: the discretised body.
        dynamics: the damping.
        h: length of a step [s].
    """

    BEND = 0.25
    """Hourglass stiffness of an element, divided by its modulus times the cube root of its volume. The value follows
    from the bending of a cube of incompressible material.
    """

    kernel = viscous_entry

    def __init__(self, body: Body, dynamics: Dynamics, h: float) -> None:
        self._body, self._dynamics, self._h = body, dynamics, h
        shape, shear = body.shape, body.table.parameters[body.material][:, SHEAR]
        points = isinstance(shape, TetOperators)
        self._places = shape.weight.shape[1] if points else 1
        self._volume = shape.weight.ravel() if points else shape.volume
        self._modulus = 2.0 * np.repeat(shear, self._places) / dynamics.slow_share
        self._moduli = [branch.share * self._modulus / (1.0 + 0.5 * h / branch.time) for branch in dynamics.prony]
        self._dash = np.full(len(self._modulus), 1.5 * dynamics.damping.viscosity / h)
        self._sum = self._dash + sum(self._moduli, np.zeros(len(self._modulus)))
        gradient = (gradients(shape.inverse) if points else shape.gradient).reshape(len(self._volume), -1)
        hourglass = np.zeros((len(self._volume), 0)) if points else shape.hourglass.reshape(len(self._volume), -1)
        modes = 0 if points else shape.hourglass.shape[1]
        self._bend = (self.BEND if modes else 0.0) * np.cbrt(self._volume)
        stiffness = np.stack([self._sum * self._volume, self._sum * self._bend], axis=1)
        self._aims = slice(2, 2 + GREEN + 3 * modes)
        numbers = np.hstack([stiffness, np.zeros((len(self._volume), GREEN + 3 * modes)), gradient, hourglass])
        cells = np.repeat(shape.cells, self._places, axis=0)
        corners = np.concatenate([[cells.shape[1], modes], cells.ravel()]).astype(np.int32)
        super().__init__(NAME, numbers.ravel(), corners)

    def stiffness(self) -> sparse.spmatrix:
        """Return the term's stiffness for the undeformed body, in the form of the constant matrix."""
        own = self._sum[:: self._places]
        return assemble(self._body.shape, own, own * self._bend[:: self._places], len(self._body.rest))

    def couplings(self) -> NDArray[np.int32]:
        """Return the vertices (m, c) of the elements."""
        return self._body.cells

    def tangents(self, positions: Array) -> Array:
        """Return the tangents (m, 3 c, 3 c) [N/m] of the elements, without the geometric stiffness of the stress."""
        tangents = np.empty((len(self._body.cells), 3 * self._body.cells.shape[1], 3 * self._body.cells.shape[1]))
        viscous_tangents(positions, self.reals, self.integers, tangents)
        return tangents

    def neutral(self) -> Saved:
        """Return the stored state of the undeformed body: strains and branches."""
        rest = self._strains(self._body.rest)
        return {
            "strain": rest,
            "before": rest,
            "branches": np.repeat(rest[None], len(self._dynamics.prony), axis=0),
            "h": np.zeros(1),
            "stored": np.zeros(1),
            "lost": np.zeros(1),
        }

    def begin(self, commands: Mapping[str, float], saved: Saved, positions: Array, ratio: float) -> None:
        """Set the strains E_hat that follow from the previous steps."""
        now = saved["strain"]
        drift = (4.0 * now - self._before(saved)) / 3.0
        total = self._dash[:, None] * drift
        for branch, modulus, held in zip(self._dynamics.prony, self._moduli, saved["branches"], strict=True):
            total += modulus[:, None] * (held + 0.5 * self._h / branch.time * (now - held))
        self.reals.reshape(len(self._volume), -1)[:, self._aims] = total / self._sum[:, None]

    def finish(self, saved: Saved, positions: Array) -> Saved:
        """Return the state to store: strains, branches, their elastic energy and the dissipated energy so far [J]."""
        now, new, h = saved["strain"], self._strains(positions), self._h
        # The mean rate: that of the stress, a backward difference, overshoots where a handle's velocity jumps.
        power = self._dynamics.damping.viscosity * self._square((new - now) / h)
        branches, stored = [], 0.0
        for branch, held in zip(self._dynamics.prony, saved["branches"], strict=True):
            ratio = 0.5 * h / branch.time
            after = (held + ratio * (new + now - held)) / (1.0 + ratio)
            mean = 0.5 * (new - after + now - held)
            power += branch.share * self._modulus / branch.time * self._square(mean)
            stored += (0.5 * branch.share * self._modulus * self._square(new - after)).sum()
            branches.append(after)
        return {
            "strain": new,
            "before": now,
            "branches": np.array(branches).reshape(saved["branches"].shape),
            "h": np.array([h]),
            "stored": np.array([stored]),
            "lost": saved["lost"] + h * power.sum(),
        }

    def energy(self, positions: Array) -> float:
        """Return 0: the energy stored in branches is reported separately."""
        return 0.0

    def _before(self, saved: Saved) -> Array:
        """Return the strains one present step length before the last state, at the rate of the last step."""
        before, length = saved["h"][0], self._h
        if before == length:
            return saved["before"]
        return saved["strain"] - (length / before if before else 0.0) * (saved["strain"] - saved["before"])

    def _strains(self, positions: Array) -> Array:
        found = np.empty((len(self._volume), self._aims.stop - self._aims.start))
        all_strains(positions, self.reals, self.integers, found)
        return found

    def _square(self, strain: Array) -> Array:
        """Return |E|^2 V + b sum_k |w_k|^2 (p,) [m^3] for the strains (p, 6 + 3 modes) of all places."""
        return square(strain, self._volume, self._bend)


def unrelaxed(state: State) -> float:
    """Return the largest elastic strain of any branch in ``state``; it relaxes although the body may not move."""
    saved = state.terms[NAME]
    return float(np.abs(saved["strain"] - saved["branches"]).max(initial=0.0))

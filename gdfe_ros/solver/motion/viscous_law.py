# SPDX-License-Identifier: Apache-2.0
"""Compiled energies, forces and tangents of Green strains: see `Viscosity`.

The energies are sum_i k_i/2 (e_i - e_hat_i)^2 over strains e that do not depend on rotations of the body. The tangent
is the Gauss-Newton part sum_i k_i de_i/dx de_i/dx^T of the second derivative. It is positive semi-definite.

A body consists of places: hexahedra, or integration points of tetrahedra. Each has c corners and ``modes`` hourglass
vectors, 4 or none. Its row of the term's reals has two stiffnesses, the strains E_hat and w_hat_k, the gradients (c, 3)
and the hourglass operators (modes, c). The term's integers are c, ``modes`` and the corners of all places.
"""

from __future__ import annotations

import numpy as np
from numpy import uint64

from gdfe_ros.compiled import inlined, kernel, vector_kernel
from gdfe_ros.solver.terms.term import as_arrays, term_kernel

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
def viscous_tangents(x, reals, integers, out):
    """Write the tangents (m, 3 c, 3 c) [N/m] of elements at positions ``x`` (n, 3) [m]: sums over their places."""
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

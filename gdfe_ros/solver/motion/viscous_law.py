# SPDX-License-Identifier: Apache-2.0
"""Compiled energies, forces and tangents of Green strains: see `Viscosity`.

The energies are sum_i k_i/2 (e_i - e_hat_i)^2 over strains e that do not depend on rotations of the body. The tangent
is the Gauss-Newton part sum_i k_i de_i/dx de_i/dx^T of the second derivative. It is positive semi-definite.
"""

from __future__ import annotations

import numpy as np
from numpy import uint64

from gdfe_ros.compiled import inlined, kernel, vector_kernel
from gdfe_ros.solver.terms.term import as_arrays, term_kernel

STRAINS = 18
"""Number of strains of an element: the six of E, and three of each hourglass vector."""
WIDTH = 2 + STRAINS + 24 + 32
"""Length of an element's data for the kernel: two stiffnesses, strains E_hat, gradient and hourglass operators."""
GREEN, POINT_WIDTH = 6, 1 + 6 + 30
"""Number of strains of an integration point, and length of its data for the kernel: stiffness, strains E_hat,
gradients.
"""


@kernel
def element_strains(f, q, out):
    """Write E (xx, yy, zz, xy, yz, zx) and w_k of a mean gradient ``f`` (3, 3) and hourglass vectors ``q`` (4, 3)."""
    for i in range(3):
        j = (i + 1) % 3
        out[i] = 0.5 * (f[0, i] * f[0, i] + f[1, i] * f[1, i] + f[2, i] * f[2, i] - 1.0)
        out[3 + i] = 0.5 * (f[0, i] * f[0, j] + f[1, i] * f[1, j] + f[2, i] * f[2, j])
    for k in range(4):
        for i in range(3):
            out[6 + 3 * k + i] = f[0, i] * q[k, 0] + f[1, i] * q[k, 1] + f[2, i] * q[k, 2]


@kernel
def gather(x, gradient, hourglass, corners, f, q):
    """Write the mean gradient ``f`` (3, 3) and hourglass vectors ``q`` (4, 3) [m] of one element."""
    f[...] = 0.0
    q[...] = 0.0
    for a in range(8):
        for i in range(3):
            position = x[corners[a], i]
            for j in range(3):
                f[i, j] += position * gradient[a, j]
            for k in range(4):
                q[k, i] += position * hourglass[k, a]


@kernel
def viscous_energy(x, reals, integers, force, size):
    """Return sum_e K/2 |E - E_hat|^2 + C/2 sum_k |w_k - w_hat_k|^2 [J], with the signature of `term_kernel`."""
    energy = 0.0
    f, q, strain, stress = np.empty((3, 3)), np.empty((4, 3)), np.empty(STRAINS), np.empty((3, 3))
    for e in range(len(integers) // 8):
        own = reals[e * WIDTH : (e + 1) * WIDTH]
        corners = integers[8 * e : 8 * e + 8]
        gradient = own[2 + STRAINS : 26 + STRAINS].reshape(8, 3)
        hourglass = own[26 + STRAINS :].reshape(4, 8)
        gather(x, gradient, hourglass, corners, f, q)
        element_strains(f, q, strain)
        stretch, bend = own[0], own[1]
        for i in range(STRAINS):
            strain[i] -= own[2 + i]
        part = 0.0
        for i in range(3):
            part += 0.5 * stretch * (strain[i] * strain[i] + 2.0 * strain[3 + i] * strain[3 + i])
        for i in range(6, STRAINS):
            part += 0.5 * bend * strain[i] * strain[i]
        for r in range(3):
            for i in range(3):
                j, b = (i + 1) % 3, (i + 2) % 3
                stress[r, i] = stretch * (f[r, i] * strain[i] + f[r, j] * strain[3 + i] + f[r, b] * strain[3 + b])
                for k in range(4):
                    stress[r, i] += bend * q[k, r] * strain[6 + 3 * k + i]
        for k in range(4):
            for r in range(3):
                pull = 0.0
                for i in range(3):
                    pull += f[r, i] * strain[6 + 3 * k + i]
                q[k, r] = bend * pull
        for a in range(8):
            for r in range(3):
                total = 0.0
                for i in range(3):
                    total += stress[r, i] * gradient[a, i]
                for k in range(4):
                    total += q[k, r] * hourglass[k, a]
                force[corners[a], r] += total
        energy += part
    size[0] += energy
    return energy


@term_kernel
def viscous_entry(x, n, reals, k, integers, i, force, size):
    """Call `viscous_energy` with the raw pointers that the terms' kernels receive."""
    return viscous_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


@kernel
def point_gradient(x, gradient, corners, f):
    """Write the deformation gradient ``f`` (3, 3) of an integration point."""
    f[...] = 0.0
    for a in range(len(corners)):
        for i in range(3):
            for j in range(3):
                f[i, j] += x[corners[a], i] * gradient[a, j]


@inlined
def green(f, i, j):
    """Return the component (i, j) of the Green strain of a deformation gradient ``f`` (3, 3)."""
    return 0.5 * (f[0, i] * f[0, j] + f[1, i] * f[1, j] + f[2, i] * f[2, j] - (1.0 if i == j else 0.0))


@kernel
def viscous_point_energy(x, reals, integers, force, size):
    """Return sum_p K/2 |E - E_hat|^2 [J] over integration points, with the signature of `term_kernel`."""
    energy, f, off, stress = 0.0, np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for p in range(len(integers) // 10):
        own, corners = reals[p * POINT_WIDTH : (p + 1) * POINT_WIDTH], integers[10 * p : 10 * p + 10]
        gradient = own[1 + GREEN :].reshape(10, 3)
        point_gradient(x, gradient, corners, f)
        for i in range(3):
            j = (i + 1) % 3
            off[i, i] = green(f, i, i) - own[1 + i]
            off[i, j] = off[j, i] = green(f, i, j) - own[4 + i]
        for i in range(3):
            for j in range(3):
                energy += 0.5 * own[0] * off[i, j] * off[i, j]
                stress[i, j] = own[0] * (f[i, 0] * off[0, j] + f[i, 1] * off[1, j] + f[i, 2] * off[2, j])
        for a in range(10):
            for i in range(3):
                for j in range(3):
                    force[corners[a], i] += stress[i, j] * gradient[a, j]
    size[0] += energy
    return energy


@term_kernel
def viscous_point_entry(x, n, reals, k, integers, i, force, size):
    """Call `viscous_point_energy` with the raw pointers that the terms' kernels receive."""
    return viscous_point_energy(*as_arrays(x, n, reals, k, integers, i, force, size))


@kernel
def point_strains(x, cells, gradient, out):
    """Write the Green strains (k, 6) of integration points at positions (n, 3) [m]."""
    f = np.empty((3, 3))
    for p in range(len(cells)):
        point_gradient(x, gradient[p], cells[p], f)
        for i in range(3):
            out[p, i], out[p, 3 + i] = green(f, i, i), green(f, i, (i + 1) % 3)


@kernel
def all_strains(x, cells, gradient, hourglass, out):
    """Write the strains (m, 18) of all elements at positions (n, 3) [m]."""
    f, q = np.empty((3, 3)), np.empty((4, 3))
    for e in range(len(cells)):
        gather(x, gradient[e], hourglass[e], cells[e], f, q)
        element_strains(f, q, out[e])


@kernel
def viscous_tangents(x, reals, integers, out):
    """Write the tangents (m, 24, 24) [N/m] of hexahedra at positions ``x`` (n, 3) [m]."""
    f, q, slope = np.empty((3, 3)), np.empty((4, 3)), np.empty((STRAINS, 24))
    for e in range(len(out)):
        own = reals[e * WIDTH : (e + 1) * WIDTH]
        gradient, hourglass = own[2 + STRAINS : 26 + STRAINS].reshape(8, 3), own[26 + STRAINS :].reshape(4, 8)
        gather(x, gradient, hourglass, integers[8 * e : 8 * e + 8], f, q)
        for a in range(8):
            green_slopes(f, gradient[a], slope[:, 3 * a : 3 * a + 3])
            for r in range(3):
                for k in range(4):
                    for i in range(3):
                        slope[6 + 3 * k + i, 3 * a + r] = gradient[a, i] * q[k, r] + f[r, i] * hourglass[k, a]
        for i in range(STRAINS):
            weight = own[0] if i < 3 else 2.0 * own[0] if i < 6 else own[1]
            slope[i] *= np.sqrt(weight)
        squares(slope, out[e])


@kernel
def viscous_point_tangents(x, reals, integers, out):
    """Write the tangents (m, 30, 30) [N/m] of tetrahedra at positions ``x`` (n, 3) [m]: sums over their points."""
    f, count = np.empty((3, 3)), len(integers) // (10 * len(out))
    slope = np.empty((GREEN * count, 30))
    for e in range(len(out)):
        for p in range(count):
            first = e * count + p
            own, part = reals[first * POINT_WIDTH : (first + 1) * POINT_WIDTH], slope[GREEN * p : GREEN * (p + 1)]
            gradient = own[1 + GREEN :].reshape(10, 3)
            point_gradient(x, gradient, integers[10 * first : 10 * first + 10], f)
            for a in range(10):
                green_slopes(f, gradient[a], part[:, 3 * a : 3 * a + 3])
            for i in range(GREEN):
                part[i] *= np.sqrt(own[0] if i < 3 else 2.0 * own[0])
        squares(slope, out[e])


@kernel
def green_slopes(f, gradient, out):
    """Write d(xx, yy, zz, xy, yz, zx of E)/dx (6, 3) of a vertex with the shape function's ``gradient`` (3,)."""
    for r in range(3):
        for i in range(3):
            j = (i + 1) % 3
            out[i, r] = f[r, i] * gradient[i]
            out[3 + i, r] = 0.5 * (f[r, i] * gradient[j] + f[r, j] * gradient[i])


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

# SPDX-License-Identifier: Apache-2.0
"""Compiled energies, forces and tangents of Green strains: see `Viscosity`.

The energies are sum_i k_i/2 (e_i - e_hat_i)^2 over strains e that do not depend on rotations of the body. The tangent
is the Gauss-Newton part sum_i k_i de_i/dx de_i/dx^T of the second derivative. It is positive semi-definite.
"""

from __future__ import annotations

import numpy as np
from numpy import uint64

from gdfe_ros.compiled import inlined, kernel, vector_kernel
from gdfe_ros.mesh.triples import dot
from gdfe_ros.solver.terms.term import as_arrays, term_kernel

STRAINS = 18
"""Number of strains of an element: the six of E, and three of each hourglass vector."""
WIDTH = 2 + STRAINS + 24 + 32
"""Length of an element's data for the kernel: two stiffnesses, strains E_hat, gradient and hourglass operators."""
GREEN, POINT_WIDTH = 6, 1 + 6 + 30
"""Number of strains of an integration point, and length of its data for the kernel: stiffness, strains E_hat,
gradients.
"""


@inlined
def weighted(x, integers, first, reals, at, stride):
    """Return the sum (3,) [m] of the positions of eight corners, with every ``stride``-th weight from ``at`` on."""
    p, q, r = 0.0, 0.0, 0.0
    for a in range(8):
        v, w = integers[first + a], reals[at + a * stride]
        p, q, r = p + w * x[v, 0], q + w * x[v, 1], r + w * x[v, 2]
    return p, q, r


@inlined
def combined(a, u, b, v, c, w):
    """Return a u + b v + c w for vectors u, v and w (3,)."""
    return a * u[0] + b * v[0] + c * w[0], a * u[1] + b * v[1] + c * w[1], a * u[2] + b * v[2] + c * w[2]


@inlined
def plus(u, a, v):
    """Return u + a v for vectors u and v (3,)."""
    return u[0] + a * v[0], u[1] + a * v[1], u[2] + a * v[2]


@inlined
def gradient_columns(x, integers, first, reals, at):
    """Return the three columns (3,) of a cell's mean deformation gradient F."""
    u = weighted(x, integers, first, reals, at, 3)
    return u, weighted(x, integers, first, reals, at + 1, 3), weighted(x, integers, first, reals, at + 2, 3)


@inlined
def green_strains(u, v, w):
    """Return the Green strains E (xx, yy, zz, xy, yz, zx) of a deformation gradient with the columns u, v and w."""
    squares = 0.5 * (dot(u, u) - 1.0), 0.5 * (dot(v, v) - 1.0), 0.5 * (dot(w, w) - 1.0)
    return (*squares, 0.5 * dot(u, v), 0.5 * dot(v, w), 0.5 * dot(w, u))


@inlined
def bent(u, v, w, q, bend, reals, at):
    """Return C (w_k - w_hat_k) (3,), its product with F (3,), and the energy [J] of an hourglass vector q_k (3,)."""
    a, b, c = dot(u, q) - reals[at], dot(v, q) - reals[at + 1], dot(w, q) - reals[at + 2]
    energy = 0.5 * bend * (a * a + b * b + c * c)
    return (bend * a, bend * b, bend * c), combined(bend * a, u, bend * b, v, bend * c, w), energy


@kernel
def viscous_energy(x, reals, integers, force, size):
    """Return sum_e K/2 |E - E_hat|^2 + C/2 sum_k |w_k - w_hat_k|^2 [J], with the signature of `term_kernel`."""
    energy = 0.0
    for e in range(len(integers) // 8):
        own, first = e * WIDTH, 8 * e
        gradient, hourglass = own + 2 + STRAINS, own + 26 + STRAINS
        u, v, w = gradient_columns(x, integers, first, reals, gradient)
        stretch, bend, at = reals[own], reals[own + 1], own + 2
        xx, yy, zz, xy, yz, zx = green_strains(u, v, w)
        xx, yy, zz = stretch * (xx - reals[at]), stretch * (yy - reals[at + 1]), stretch * (zz - reals[at + 2])
        xy, yz, zx = stretch * (xy - reals[at + 3]), stretch * (yz - reals[at + 4]), stretch * (zx - reals[at + 5])
        if stretch > 0.0:
            energy += 0.5 / stretch * (xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + yz * yz + zx * zx))
        r, s, t = combined(xx, u, xy, v, zx, w), combined(xy, u, yy, v, yz, w), combined(zx, u, yz, v, zz, w)
        a = weighted(x, integers, first, reals, hourglass, 1)
        b = weighted(x, integers, first, reals, hourglass + 8, 1)
        c = weighted(x, integers, first, reals, hourglass + 16, 1)
        d = weighted(x, integers, first, reals, hourglass + 24, 1)
        pull_a, back_a, stored_a = bent(u, v, w, a, bend, reals, at + 6)
        pull_b, back_b, stored_b = bent(u, v, w, b, bend, reals, at + 9)
        pull_c, back_c, stored_c = bent(u, v, w, c, bend, reals, at + 12)
        pull_d, back_d, stored_d = bent(u, v, w, d, bend, reals, at + 15)
        energy += stored_a + stored_b + stored_c + stored_d
        r = plus(plus(plus(plus(r, pull_a[0], a), pull_b[0], b), pull_c[0], c), pull_d[0], d)
        s = plus(plus(plus(plus(s, pull_a[1], a), pull_b[1], b), pull_c[1], c), pull_d[1], d)
        t = plus(plus(plus(plus(t, pull_a[2], a), pull_b[2], b), pull_c[2], c), pull_d[2], d)
        for i in range(8):
            n, at = integers[first + i], gradient + 3 * i
            total = combined(reals[at], r, reals[at + 1], s, reals[at + 2], t)
            at = hourglass + i
            total = plus(plus(total, reals[at], back_a), reals[at + 8], back_b)
            total = plus(plus(total, reals[at + 16], back_c), reals[at + 24], back_d)
            force[n, 0] += total[0]
            force[n, 1] += total[1]
            force[n, 2] += total[2]
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
def all_strains(x, reals, integers, out):
    """Write E and w_k (m, 18) of all hexahedra at positions ``x`` (n, 3) [m]."""
    for e in range(len(out)):
        own, first = e * WIDTH, 8 * e
        u, v, w = gradient_columns(x, integers, first, reals, own + 2 + STRAINS)
        out[e, 0], out[e, 1], out[e, 2], out[e, 3], out[e, 4], out[e, 5] = green_strains(u, v, w)
        for k in range(4):
            q = weighted(x, integers, first, reals, own + 26 + STRAINS + 8 * k, 1)
            at = 6 + 3 * k
            out[e, at], out[e, at + 1], out[e, at + 2] = dot(u, q), dot(v, q), dot(w, q)


@kernel
def viscous_tangents(x, reals, integers, out):
    """Write the tangents (m, 24, 24) [N/m] of hexahedra at positions ``x`` (n, 3) [m]."""
    f, slope = np.empty((3, 3)), np.empty((STRAINS, 24))
    for e in range(len(out)):
        own, first = e * WIDTH, 8 * e
        gradient, hourglass = own + 2 + STRAINS, own + 26 + STRAINS
        u, v, w = gradient_columns(x, integers, first, reals, gradient)
        f[:, 0], f[:, 1], f[:, 2] = u, v, w
        for a in range(8):
            own_gradient = reals[gradient + 3 * a : gradient + 3 * a + 3]
            green_slopes(f, own_gradient, slope[:, 3 * a : 3 * a + 3])
            for k in range(4):
                q = weighted(x, integers, first, reals, hourglass + 8 * k, 1)
                for i in range(3):
                    for r in range(3):
                        bend = own_gradient[i] * q[r] + f[r, i] * reals[hourglass + 8 * k + a]
                        slope[6 + 3 * k + i, 3 * a + r] = bend
        for i in range(STRAINS):
            weight = reals[own] if i < 3 else 2.0 * reals[own] if i < 6 else reals[own + 1]
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

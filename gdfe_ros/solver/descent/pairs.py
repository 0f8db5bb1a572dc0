# SPDX-License-Identifier: Apache-2.0
"""Compiled quasi-Newton direction d = -H g from a history of pairs.

The inverse Hessian is kept in the compact form of Byrd, Nocedal and Schnabel (1994): see `quasi_newton`. Threads divide
the pairs of the history for the products, and the unknowns for the direction. Every sum is taken in the same order as
in one thread.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from gdfe_ros.compiled import internal, kernel, parallel_kernel, vector_kernel
from gdfe_ros.solver.distance import largest

CURVATURE = 1e-10
"""A pair enters the history if the cosine between the step and the change of the gradient is at least this."""
LARGE = 50_000
"""Least number of unknowns for which threads divide the work on the history and on the gradient."""
MOST_SHORTENED = 1e-4
"""Least length of the quasi-Newton direction, divided by the length of the plain preconditioned step. A shorter
direction empties the history: the last pairs of a very accurate solve consist of rounding. With them a body would seem
to be at rest after its command has changed.
"""


@vector_kernel
def inner(a, b):
    """Return the inner product of two flat vectors."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@internal
def drop_oldest(work, count):
    """Remove the oldest pair, so that the last slot of the history is free."""
    oldest = work.row[0]
    for i in range(count - 1):
        work.row[i] = work.row[i + 1]
        for j in range(count - 1):
            work.triangle[i, j] = work.triangle[i + 1, j + 1]
            work.gram[i, j] = work.gram[i + 1, j + 1]
        work.products[0, i] = work.products[0, i + 1]
        work.products[1, i] = work.products[1, i + 1]
    work.row[count - 1] = oldest


@vector_kernel
def remember(work):
    """Add the pair of the last accepted iteration to the history; skip it if its curvature is too small.

    The products of the pair with the older pairs are computed later, together with the next direction.
    """
    status = work.status[0]
    count = status.count
    s, g, old, z, z_old = work.direction, work.gradient, work.old, work.step, work.trial
    curvature, norm, length, change = 0.0, 0.0, 0.0, 0.0
    for n in range(len(s)):
        y = g[n] - old[n]
        curvature += s[n] * y
        norm += (z[n] - z_old[n]) * y
        length += s[n] * s[n]
        change += y * y
    if not curvature > CURVATURE * np.sqrt(length * change):
        return
    if count == len(work.row):
        drop_oldest(work, count)
        count -= 1
    steps, images = work.steps[work.row[count]], work.images[work.row[count]]
    for n in range(len(s)):
        steps[n] = s[n]
        images[n] = z[n] - z_old[n]
    work.triangle[count, count] = curvature
    work.gram[count, count] = norm
    status.serial += 1
    work.serial[work.row[count]] = status.serial
    status.count = count + 1
    status.pending = 1


@kernel
def multiply_history(work, first, last):
    """Write the products s_i . g and v_i . g of the pairs from ``first`` up to ``last``."""
    for i in range(first, last):
        work.products[2, i] = inner(work.steps[work.row[i]], work.gradient)
        work.products[3, i] = inner(work.images[work.row[i]], work.gradient)


@parallel_kernel
def multiply_in_threads(threads, work, count):
    """Do `multiply_history` with the pairs divided among threads."""
    for part in prange(threads):
        multiply_history(work, part * count // threads, (part + 1) * count // threads)


@kernel
def take_products(work, threads):
    """Write the products of all pairs with the gradient; derive the newest pair's products with the older pairs."""
    status = work.status[0]
    count = status.count
    if threads is None or len(work.direction) < LARGE:
        multiply_history(work, 0, count)
    else:
        multiply_in_threads(threads, work, count)
    p, w = work.products[0], work.products[1]
    new = count - 1 if status.pending == 1 else count
    for i in range(count):
        along, image = work.products[2, i], work.products[3, i]
        if i < new < count:
            work.triangle[i, new] = along - p[i]
            work.gram[i, new] = work.gram[new, i] = image - w[i]
        p[i], w[i] = along, image
    status.pending = 0


@kernel
def combine(work, scale, first, last):
    """Write the entries from ``first`` up to ``last`` of the direction d = -H g, by summing over the pairs."""
    d, z = work.direction, work.step
    for n in range(first, last):
        d[n] = -scale * z[n]
    for i in range(work.status[0].count):
        a, b = work.products[3, i], scale * work.products[2, i]
        s, v = work.steps[work.row[i]], work.images[work.row[i]]
        for n in range(first, last):
            d[n] += b * v[n] - a * s[n]


@parallel_kernel
def combine_in_threads(threads, work, scale):
    """Do `combine` with the unknowns divided among threads."""
    count = len(work.direction)
    for part in prange(threads):
        combine(work, scale, part * count // threads, (part + 1) * count // threads)


@internal
def find_direction(work, threads):
    """Write the quasi-Newton direction d = -H g, its slope g . d [J] and its largest displacement [m]."""
    status = work.status[0]
    count = status.count
    take_products(work, threads)
    g, z, d = work.gradient, work.step, work.direction
    p, w = work.products[0], work.products[1]
    scale = work.triangle[count - 1, count - 1] / work.gram[count - 1, count - 1] if count else 1.0
    lower, upper = work.products[2], work.products[3]
    for i in range(count - 1, -1, -1):
        lower[i] = p[i]
        for j in range(i + 1, count):
            lower[i] -= work.triangle[i, j] * lower[j]
        lower[i] /= work.triangle[i, i]
    for i in range(count):
        upper[i] = work.triangle[i, i] * lower[i] - scale * w[i]
        for j in range(count):
            upper[i] += scale * work.gram[i, j] * lower[j]
    for i in range(count):
        for j in range(i):
            upper[i] -= work.triangle[j, i] * upper[j]
        upper[i] /= work.triangle[i, i]
    if threads is None or len(d) < LARGE:
        combine(work, scale, 0, len(d))
    else:
        combine_in_threads(threads, work, scale)
    status.slope = inner(d, g)
    far, plain = largest(d), largest(z)
    if count and not (status.slope < 0.0 and far > MOST_SHORTENED * plain):
        status.count = 0
        find_direction(work, threads)
    else:
        status.distance = far

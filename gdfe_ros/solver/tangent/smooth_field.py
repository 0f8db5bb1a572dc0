# SPDX-License-Identifier: Apache-2.0
"""A smooth field that contains the softest modes of a body."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

DEGREE = 3
"""Degree of the polynomials of the field; the softest modes have such shapes."""


def smooth_field(points: NDArray[np.float64], pieces: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return a field (n, 3) over ``points`` (n, 3) [m] that contains every polynomial up to the degree `DEGREE`.

    Each connected piece has its own polynomials. Common polynomials of two distant pieces would be almost linear over
    each piece. ``pieces`` (n,) is the number of the piece of each point, from 0.
    """
    field = np.empty_like(points)
    for piece in range(int(pieces.max(initial=-1)) + 1):
        own = pieces == piece
        field[own] = _polynomials(points[own])
    return field


def _polynomials(points: NDArray[np.float64]) -> NDArray[np.float64]:
    scaled = (points - points.mean(axis=0)) / max(float(np.ptp(points, axis=0).max()), np.finfo(float).tiny)
    columns = [np.ones(len(points))]
    for degree in range(1, DEGREE + 1):
        columns += [scaled[:, list(axes)].prod(axis=1) for axes in combinations_with_replacement(range(3), degree)]
    return np.stack(columns, axis=1) @ np.random.default_rng(0).standard_normal((len(columns), 3))

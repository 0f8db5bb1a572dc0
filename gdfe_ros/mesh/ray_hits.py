# SPDX-License-Identifier: Apache-2.0
"""Compiled search for the first triangle on each of many rays."""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.mesh.box_tree import LEAF
from gdfe_ros.mesh.triples import corner, cross, dot, minus

EDGE = 1e-9
"""Barycentric width by which a triangle is larger for rays, so that no ray slips through an edge."""


@internal
def ray_length(start, direction, corners):
    """Return the distance along a ray at which it pierces a triangle; inf if it does not (Moeller and Trumbore)."""
    a = corner(corners, 0)
    e, f = minus(corner(corners, 1), a), minus(corner(corners, 2), a)
    p = cross(direction, f)
    volume = dot(e, p)
    if volume == 0.0:
        return math.inf
    s = minus(start, a)
    u, q = dot(s, p) / volume, cross(s, e)
    v = dot(direction, q) / volume
    return dot(f, q) / volume if u >= -EDGE and v >= -EDGE and u + v <= 1.0 + EDGE else math.inf


@internal
def box_length(start, direction, box):
    """Return the distance along a ray at which it enters a box, 0 from inside; inf if it misses the box."""
    near, far = 0.0, math.inf
    for x in range(3):
        if direction[x] == 0.0:
            if start[x] < box[0, x] or start[x] > box[1, x]:
                return math.inf
        else:
            a, b = (box[0, x] - start[x]) / direction[x], (box[1, x] - start[x]) / direction[x]
            near, far = max(near, min(a, b)), min(far, max(a, b))
    return near if near <= far * (1.0 + 1e-12) else math.inf


@kernel
def first_hits(starts, directions, corners, boxes, least, lengths, hits):
    """Write the distance to the first triangle of a `BoxTree` on each ray, and the number of this triangle.

    Args:
        starts: (r, 3) [m] starts of the rays.
        directions: (r, 3) unit vectors of the rays.
        corners: (t, 3, 3) [m] corners of the tree's triangles.
        boxes: (n, 2, 3) [m] boxes of the tree's nodes.
        least: distance [m] up to which triangles are left out, such as the one on which a ray starts.
        lengths: (r,) [m], inf if there is none, output.
        hits: (r,) int64 sorted number of the triangle, -1 if there is none, output.
    """
    first_leaf, stack = len(boxes) // 2, np.empty(128, np.int64)
    for r in range(len(starts)):
        best, hit = math.inf, -1
        place, direction = corner(starts, r), corner(directions, r)
        stack[0], depth = 0, 1
        while depth > 0:
            depth -= 1
            node = stack[depth]
            if box_length(place, direction, boxes[node]) >= best:
                continue
            if node < first_leaf:
                left, right = 2 * node + 1, 2 * node + 2
                if box_length(place, direction, boxes[left]) < box_length(place, direction, boxes[right]):
                    left, right = right, left
                stack[depth], stack[depth + 1] = left, right
                depth += 2
                continue
            start = (node - first_leaf) * LEAF
            for j in range(start, min(start + LEAF, len(corners))):
                length = ray_length(place, direction, corners[j])
                if least < length < best:
                    best, hit = length, j
        lengths[r], hits[r] = best, hit

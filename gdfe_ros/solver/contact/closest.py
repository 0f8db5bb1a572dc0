# SPDX-License-Identifier: Apache-2.0
"""Compiled closest points on bilinear faces, and the search for the face that a vertex can touch."""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined, kernel

MOST_STEPS = 12
"""Largest number of Gauss-Newton iterations in one closest-point search. A flat face needs two."""
EQUAL = 1e-9
"""Two distances count as equal if they differ by less than this fraction."""
OPPOSED = -0.5
"""Largest cosine between the normals of a face and of a vertex, or of a face around it, that can touch each other."""


@kernel
def face_areas(x, quads, out):
    """Write the area vectors (q, 3) [m^2] of the faces ``quads`` to ``out``; they point out of the body."""
    for f in range(len(quads)):
        a, b, c, d = quads[f, 0], quads[f, 1], quads[f, 2], quads[f, 3]
        p0, p1, p2 = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
        q0, q1, q2 = x[d, 0] - x[b, 0], x[d, 1] - x[b, 1], x[d, 2] - x[b, 2]
        out[f, 0] = 0.5 * (p1 * q2 - p2 * q1)
        out[f, 1] = 0.5 * (p2 * q0 - p0 * q2)
        out[f, 2] = 0.5 * (p0 * q1 - p1 * q0)


@kernel
def corner_normals(areas, starts, smooth, out):
    """Write unit normals (q, 4, 3) at the corners of faces, as area-weighted means over the faces in ``smooth``.

    Args:
        areas: (q, 3) [m^2] area vectors of the faces.
        starts: (4 q + 1,) index into ``smooth`` at which the list of each corner begins.
        smooth: indices of the faces that are averaged at each corner.
        out: (q, 4, 3), is written.
    """
    for f in range(len(areas)):
        for a in range(4):
            n0, n1, n2 = 0.0, 0.0, 0.0
            for i in range(starts[4 * f + a], starts[4 * f + a + 1]):
                n0, n1, n2 = n0 + areas[smooth[i], 0], n1 + areas[smooth[i], 1], n2 + areas[smooth[i], 2]
            length = math.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
            scale = 1.0 / length if length > 0.0 else 0.0
            out[f, a, 0], out[f, a, 1], out[f, a, 2] = scale * n0, scale * n1, scale * n2


@inlined
def weights_at(u, v):
    """Return the bilinear weights (4,) of a face's corners at the face coordinates u, v, each in [0, 1]."""
    return (1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v


@inlined
def clamped(value):
    """Return a face coordinate clamped to [0, 1]."""
    return min(max(value, 0.0), 1.0)


@inlined
def closest_on(x, quads, f, px, py, pz):
    """Return the face coordinates u, v of the closest point of face ``f`` to the point p [m]."""
    a, b, c, d = quads[f, 0], quads[f, 1], quads[f, 2], quads[f, 3]
    u, v = 0.5, 0.5
    for _ in range(MOST_STEPS):
        uu, uv, vv, ru, rv = 0.0, 0.0, 0.0, 0.0, 0.0
        wa, wb, wc, wd = weights_at(u, v)
        for axis in range(3):
            p = px if axis == 0 else (py if axis == 1 else pz)
            xa, xb, xc, xd = x[a, axis], x[b, axis], x[c, axis], x[d, axis]
            e = (1.0 - v) * (xb - xa) + v * (xc - xd)
            g = (1.0 - u) * (xd - xa) + u * (xc - xb)
            r = p - (wa * xa + wb * xb + wc * xc + wd * xd)
            uu, uv, vv, ru, rv = uu + e * e, uv + e * g, vv + g * g, ru + e * r, rv + g * r
        det = uu * vv - uv * uv
        if not det > 0.0:
            break
        du, dv = (vv * ru - uv * rv) / det, (uu * rv - uv * ru) / det
        if not (0.0 <= u + du <= 1.0 and 0.0 <= v + dv <= 1.0):
            # If the free minimum lies outside of the square, the constrained minimum lies on a side that it crossed.
            du1 = clamped(u + du) - u
            dv1 = clamped(v + (rv - uv * du1) / vv) - v
            dv2 = clamped(v + dv) - v
            du2 = clamped(u + (ru - uv * dv2) / uu) - u
            one = 0.5 * (uu * du1 * du1 + 2.0 * uv * du1 * dv1 + vv * dv1 * dv1) - ru * du1 - rv * dv1
            two = 0.5 * (uu * du2 * du2 + 2.0 * uv * du2 * dv2 + vv * dv2 * dv2) - ru * du2 - rv * dv2
            du, dv = (du1, dv1) if one <= two else (du2, dv2)
        u, v = clamped(u + du), clamped(v + dv)
        if abs(du) + abs(dv) < 1e-12:
            break
    return u, v


@inlined
def point_on(x, quads, f, u, v):
    """Return the point (3,) [m] of face ``f`` at the face coordinates u, v."""
    w = weights_at(u, v)
    p0, p1, p2 = 0.0, 0.0, 0.0
    for a in range(4):
        q = quads[f, a]
        p0, p1, p2 = p0 + w[a] * x[q, 0], p1 + w[a] * x[q, 1], p2 + w[a] * x[q, 2]
    return p0, p1, p2


@inlined
def opposes(areas, starts, about, vertex, n0, n1, n2):
    """Return whether a vertex, or any face around it, has a normal whose cosine with n (3,) is below `OPPOSED`.

    The normal of a vertex is the mean of those around it, which opposes what a sharp tip touches.
    """
    s0, s1, s2 = 0.0, 0.0, 0.0
    for i in range(starts[vertex], starts[vertex + 1]):
        m0, m1, m2 = areas[about[i], 0], areas[about[i], 1], areas[about[i], 2]
        size = max(math.sqrt(m0 * m0 + m1 * m1 + m2 * m2), 1e-300)
        m0, m1, m2 = m0 / size, m1 / size, m2 / size
        if m0 * n0 + m1 * n1 + m2 * n2 < OPPOSED:
            return True
        s0, s1, s2 = s0 + m0, s1 + m1, s2 + m2
    return s0 * n0 + s1 * n1 + s2 * n2 < OPPOSED * math.sqrt(s0 * s0 + s1 * s1 + s2 * s2)


@inlined
def among(starts, values, row, value):
    """Return whether a row of a ragged list contains a value, by bisection; each row is in ascending order."""
    low, high = starts[row], starts[row + 1]
    while low < high:
        middle = (low + high) // 2
        if values[middle] < value:
            low = middle + 1
        else:
            high = middle
    return low < starts[row + 1] and values[low] == value


@inlined
def to_box(x, corners, p0, p1, p2):
    """Return the distance [m] from the point p to the box, along the axes, of the points ``corners`` (c,) of ``x``."""
    square = 0.0
    for axis in range(3):
        p = p0 if axis == 0 else (p1 if axis == 1 else p2)
        low, high = x[corners[0], axis], x[corners[0], axis]
        for a in range(1, len(corners)):
            low, high = min(low, x[corners[a], axis]), max(high, x[corners[a], axis])
        away = max(low - p, p - high, 0.0)
        square += away * away
    return math.sqrt(square)


@kernel
def may_touch(x, pairs, faces, surface, within, out):
    """Write to ``out`` (p,) whether each vertex and face may touch each other.

    They may if the vertex is not near the face, as `Topology` defines it, and comes within a distance [m] of its box.
    """
    for pair in range(len(pairs)):
        f, v = faces[pair], surface.vertices[pairs[pair]]
        close = to_box(x, surface.quads[f], x[v, 0], x[v, 1], x[v, 2]) <= within
        out[pair] = close and not among(surface.near_starts, surface.near, f, v)


@kernel
def least_distance(x, pairs, faces, surface, most):
    """Return the least distance [m] of a vertex of the ``pairs`` (p,) from its face of ``faces`` (p,), up to ``most``.

    Normals do not count: what does not oppose may come to oppose.
    """
    for pair in range(len(pairs)):
        f, v = faces[pair], surface.vertices[pairs[pair]]
        p0, p1, p2 = x[v, 0], x[v, 1], x[v, 2]
        if to_box(x, surface.quads[f], p0, p1, p2) < most:
            c0, c1, c2 = point_on(x, surface.quads, f, *closest_on(x, surface.quads, f, p0, p1, p2))
            most = min(most, math.sqrt((p0 - c0) ** 2 + (p1 - c1) ** 2 + (p2 - c2) ** 2))
    return most


@inlined
def face_plane(normals, f, w, rim, d, away):
    """Return the plane that a vertex must stay in front of, at the closest point of face ``f`` with weights ``w`` (4,).

    The vertex lies at ``d`` (3,) [m], with the length ``away`` [m], from this point. The result is the unit normal
    (three numbers), the height [m] above the plane, and the fraction of the contact force that the face carries. The
    fraction is -1 if the vertex cannot touch the face.
    """
    m0, m1, m2 = 0.0, 0.0, 0.0
    for a in range(4):
        m0, m1, m2 = m0 + w[a] * normals[f, a, 0], m1 + w[a] * normals[f, a, 1], m2 + w[a] * normals[f, a, 2]
    length = math.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
    if not length > 0.0:
        return 0.0, 0.0, 0.0, 0.0, -1.0
    m0, m1, m2 = m0 / length, m1 / length, m2 / length
    height = m0 * d[0] + m1 * d[1] + m2 * d[2]
    beside = math.sqrt(max(0.0, away * away - height * height))
    if beside <= rim:
        return m0, m1, m2, height, 1.0 - min(1.0, beside / rim) ** 2
    if height < 0.0:
        return m0, m1, m2, height, -1.0
    # The vertex lies beside the face, at a convex edge: the edge itself is the closest point.
    return d[0] / away, d[1] / away, d[2] / away, away, 1.0


@kernel
def nearest_faces(
    x, last, sunk, pairs, faces, surface, areas, normals, reach, distance, face, weights, normal, gap, support
):
    """Find, for each surface vertex, the nearest face that the vertex can touch.

    Args:
        x: (n, 3) [m] positions.
        last: (n, 3) [m] positions of the last accepted state.
        sunk: (k,) whether each vertex already penetrated at ``last``. Such a vertex takes its nearest face, even if it
            is deep behind this face.
        pairs: (p,) vertex of each candidate pair, as an index into the surface's vertices.
        faces: (p,) face of each candidate pair.
        surface: the topology of an `OwnSurface`.
        areas: (q, 3) [m^2] area vectors of the faces at ``x``.
        normals: (q, 4, 3) unit normals at the corners of the faces.
        reach: [m] search distance.
        distance: (k,) [m], is written: distance to the nearest face; infinite if no face is within reach.
        face: (k,) int64, is written: the nearest face; -1 if no face is within reach.
        weights: (k, 4), is written: weights of the face's corners at the closest point.
        normal: (k, 3), is written: unit normal of the plane that the vertex must stay in front of.
        gap: (k,) [m], is written: signed distance to that plane.
        support: (k,), is written: fraction of the contact force that the face carries. It is 1 above the face and falls
            to 0 across the rim beside it. Beyond the rim of a convex edge it is 1: the vertex then touches the edge.
    """
    quads = surface.quads
    for pair in range(len(pairs)):
        i, f = pairs[pair], faces[pair]
        vertex = surface.vertices[i]
        size = math.sqrt(areas[f, 0] ** 2 + areas[f, 1] ** 2 + areas[f, 2] ** 2)
        px, py, pz = x[vertex, 0], x[vertex, 1], x[vertex, 2]
        if not size > 0.0 or to_box(x, quads[f], px, py, pz) > (1.0 + 2.0 * EQUAL) * min(reach, distance[i]):
            continue
        n0, n1, n2 = areas[f, 0] / size, areas[f, 1] / size, areas[f, 2] / size
        if not opposes(areas, surface.about_starts, surface.about, vertex, n0, n1, n2):
            continue
        u, v = closest_on(x, quads, f, px, py, pz)
        c0, c1, c2 = point_on(x, quads, f, u, v)
        d0, d1, d2 = px - c0, py - c1, pz - c2
        away = math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
        if away > reach or away > (1.0 + EQUAL) * distance[i]:
            continue
        w = weights_at(u, v)
        m0, m1, m2, height, share = face_plane(normals, f, w, surface.rim, (d0, d1, d2), away)
        if share < 0.0:
            continue
        if height < -surface.depth and not (sunk[i] or was_before(last, quads, f, vertex, w)):
            continue
        if away >= (1.0 - EQUAL) * distance[i] and not is_better(share, height, support[i], gap[i]):
            continue
        distance[i], face[i], gap[i], support[i] = away, f, height, share
        normal[i, 0], normal[i, 1], normal[i, 2] = m0, m1, m2
        for a in range(4):
            weights[i, a] = w[a]


@inlined
def is_better(share, height, other_share, other_height):
    """Return whether a face suits a vertex better than another one that is as near, at an edge or a corner of both.

    It carries a larger fraction of the force; of two alike, it is the one whose plane is farther from the vertex.
    """
    if abs(share - other_share) > EQUAL:
        return share > other_share
    return abs(height) > (1.0 + EQUAL) * abs(other_height)


@inlined
def was_before(last, quads, f, vertex, w):
    """Return whether a vertex was in front of a face at ``last`` (n, 3) [m]; ``w`` (4,) weights the face's corners."""
    c0, c1, c2 = 0.0, 0.0, 0.0
    for a in range(4):
        q = quads[f, a]
        c0, c1, c2 = c0 + w[a] * last[q, 0], c1 + w[a] * last[q, 1], c2 + w[a] * last[q, 2]
    d0, d1, d2 = last[vertex, 0] - c0, last[vertex, 1] - c1, last[vertex, 2] - c2
    a, b, c, d = quads[f, 0], quads[f, 1], quads[f, 2], quads[f, 3]
    p0, p1, p2 = last[c, 0] - last[a, 0], last[c, 1] - last[a, 1], last[c, 2] - last[a, 2]
    q0, q1, q2 = last[d, 0] - last[b, 0], last[d, 1] - last[b, 1], last[d, 2] - last[b, 2]
    n0, n1, n2 = p1 * q2 - p2 * q1, p2 * q0 - p0 * q2, p0 * q1 - p1 * q0
    return n0 * d0 + n1 * d1 + n2 * d2 > 0.0

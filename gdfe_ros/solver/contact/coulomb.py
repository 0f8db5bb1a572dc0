# SPDX-License-Identifier: Apache-2.0
"""Compiled Coulomb friction of every contact: return mapping of the force, and energy (Moreau envelope of mu l |s|)."""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined


@inlined
def shortened(t0, t1, t2, limit):
    """Return the trial friction force t (3,) [N] shortened to at most ``limit`` [N], and the length of t [N]."""
    trial = math.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
    share = limit / trial if trial > limit else 1.0
    return share * t0, share * t1, share * t2, trial


@inlined
def envelope(trial, limit):
    """Return 2 k times the friction energy (Moreau envelope) [N^2] of a trial force of length ``trial`` [N].

    Here k [N/m] is the penalty. ``limit`` [N] is the largest friction force.
    """
    return trial * trial if trial <= limit else limit * (2.0 * trial - limit)


@inlined
def add_friction_tangent(k, limit, force, trial, normal, out):
    """Add the Hessian [N/m] of the friction energy of one point to ``out`` (3, 3).

    With the contact's ``normal`` n, it is k (1 - n n^T) if the point sticks. If the trial force of length ``trial`` [N]
    exceeds the ``limit`` [N], the point slips along the friction ``force`` f [N], s = f/|f|, and it is
    k limit/trial (1 - n n^T - s s^T).
    """
    slips = trial > limit
    share, unit = (k * limit / trial, 1.0 / limit) if slips else (k, 0.0)
    for a in range(3):
        out[a, a] += share
        for b in range(3):
            out[a, b] -= share * (normal[a] * normal[b] + unit * force[a] * unit * force[b])

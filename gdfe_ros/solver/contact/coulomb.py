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

# SPDX-License-Identifier: Apache-2.0
"""Compiled Coulomb friction, the Moreau envelope of mu l |s|: the return mapping that every contact applies."""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined


@inlined
def shortened(t0, t1, t2, limit):
    """Return the trial friction force t (3,) [N] shortened to at most ``limit`` [N], and the trial's length [N]."""
    trial = math.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
    share = limit / trial if trial > limit else 1.0
    return share * t0, share * t1, share * t2, trial


@inlined
def envelope(trial, limit):
    """Return the Moreau envelope at a trial force of length ``trial`` [N], times twice the penalty [N^2]."""
    return trial * trial if trial <= limit else limit * (2.0 * trial - limit)

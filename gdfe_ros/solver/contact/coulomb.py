# SPDX-License-Identifier: Apache-2.0
"""Coulomb's law as the Moreau envelope of mu l |s|, compiled: what every contact does with the trial of its shear."""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined


@inlined
def shortened(t0, t1, t2, limit):
    """Return the shear [N] that friction up to ``limit`` [N] holds of a trial, and the length of that."""
    trial = math.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
    share = limit / trial if trial > limit else 1.0
    return share * t0, share * t1, share * t2, trial


@inlined
def envelope(trial, limit):
    """Return the envelope at a trial of this length [N], times twice the penalty [N^2]."""
    return trial * trial if trial <= limit else limit * (2.0 * trial - limit)

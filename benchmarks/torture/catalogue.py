# SPDX-License-Identifier: Apache-2.0
"""All cases of the torture test."""

from __future__ import annotations

from benchmarks.torture import (
    actuation,
    commands,
    contrasts,
    honesty,
    laws,
    meshes,
    pokes,
    scales,
    scenes,
    snaps,
    starts,
    touches,
    walks,
)
from benchmarks.torture.case import Case


def all_cases(*, walk_steps: int = walks.STEPS) -> list[Case]:
    """Return all cases, group by group; random walks have ``walk_steps`` steps, random pokes at most this number."""
    groups = (starts, commands, contrasts, scales, meshes, laws)
    found = [case for group in groups for case in group.cases()]
    found += [*walks.cases(walk_steps), *actuation.cases(), *snaps.cases(), *scenes.cases(), *honesty.cases()]
    found += touches.cases(min(touches.POKES, walk_steps))
    found += pokes.cases(min(pokes.POKES, walk_steps))
    return found

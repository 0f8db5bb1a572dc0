# SPDX-License-Identifier: Apache-2.0
"""A row of the table: the tasks that both commits carry out, what is measured, and what is to be reached."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

NONE = "beyond", "unconverged", "unjudged", "unverified"
"""Figures of which a row of statics may have none."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """A scene and the steps that are made in it. All values are those of JSON, because another process reads them.

    Attributes:
        scene: name of a shipped scene; empty if ``text`` is given.
        text: text of a scene file.
        overrides: dict from key of the scene to value.
        tolerance: tolerance of the solver that replaces the scene's.
        total: number of equal steps of the scene's program.
        parts: dict from name to the first and last of these steps that are made; steps between two parts are made once,
            and are not timed.
        commands: commands of single steps, instead of the program's.
        limit: processor time [s] after which no further command is given when errors are measured.
        label: name of the task in a row with several ones.
    """

    scene: str = ""
    text: str = ""
    overrides: Mapping[str, Any] = field(default_factory=dict)
    tolerance: float | None = None
    total: int = 1
    parts: Mapping[str, Sequence[int]] = field(default_factory=lambda: {"": (0, 1)})
    commands: Sequence[Mapping[str, Any]] = ()
    limit: float = 60.0
    label: str = ""

    @property
    def request(self) -> dict[str, Any]:
        """The task as the other process reads it."""
        return asdict(self)

    @property
    def key(self) -> str:
        """A digest that identifies the task in the file of known errors."""
        return hashlib.sha256(json.dumps(self.request, sort_keys=True).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Target:
    """What a figure of a row has to reach.

    Attributes:
        figure: name of the figure, a key of the row's figures or ``ratio``.
        bound: its bound.
        least: whether the figure has to be at least the bound; otherwise at most.
        part: part of the task that has to reach it; None for all parts.
    """

    figure: str
    bound: float
    least: bool = False
    part: str | None = None

    @property
    def words(self) -> str:
        """The target in a few words."""
        return f"{self.figure} {'>=' if self.least else '<='} {self.bound:g}"

    def met(self, figures: Mapping[str, Any]) -> bool | None:
        """Return whether the figures of a row meet the target; None if they lack the figure."""
        value = figures.get(self.figure)
        if value is None:
            return None
        return value >= self.bound if self.least else value <= self.bound


@dataclass(frozen=True, kw_only=True)
class Row:
    """A row of the table, or several rows, if its task has several parts.

    Attributes:
        group: name of the group.
        name: name of the row, unique in the table.
        tasks: tasks; only a row of errors has more than one.
        unit: unit of its times: ``ms`` a step, times ``real time``, or ``s`` of all steps.
        repeats: number of times that a task is carried out in one turn.
        turns: number of pairs.
        errors: way of measuring true errors: ``path`` repeats the stream at `fine` tolerances, ``each`` continues each
            step at a fine tolerance, and empty leaves them out.
        fine: fine tolerance, divided by the row's.
        bends: displacement across x, divided by the size, from which a body counts as bent; None: not asked.
        push: whether the finer solves of middle and last steps are also repeated from pushed places.
        targets: what has to be reached.
    """

    group: str
    name: str
    tasks: tuple[Task, ...]
    unit: str = "ms"
    repeats: int = 1
    turns: int = 5
    errors: str = ""
    fine: float = 1e-3
    bends: float | None = None
    push: bool = False
    targets: tuple[Target, ...] = ()


def limit_ratio(ratio: float) -> tuple[Target, ...]:
    """Return the targets of a timed row of statics: a ratio of times, and no converged step beyond its tolerance."""
    return Target("ratio", ratio), *HONEST


HONEST = tuple(Target(name, bound) for name, bound in (("error", 1.0), *((name, 0) for name in NONE)))
"""Targets of every row of statics: no error beyond a tolerance, every step converged, every finer solve checked."""
STABLE = *HONEST, Target("saddles", 0), Target("cut", 0)
"""Targets of a row of errors: also no saddle that is called stable, and no step left out for want of time."""

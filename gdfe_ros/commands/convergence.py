# SPDX-License-Identifier: Apache-2.0
"""Which steps of a run did not converge, when and why, for people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from rich.console import Console

MOST_LINES = 3
"""Steps that are named one by one."""


class Outcome(Protocol):
    """The outcome of a step, as results and records have it."""

    @property
    def converged(self) -> bool:
        """Whether the step reached its tolerance."""

    @property
    def time(self) -> float:
        """Simulation time [s]."""

    @property
    def message(self) -> str:
        """Why it did not converge."""


def convergence(steps: Sequence[Outcome]) -> str:
    """Return ``yes``, or ``no: 3 of 100 steps``."""
    failed = sum(not step.converged for step in steps)
    return f"no: {failed} of {len(steps)} steps" if failed else "yes"


def print_failures(steps: Sequence[Outcome], *, first: int = 1) -> None:
    """Print to stderr number, time and reason of steps that did not converge; ``first`` numbers the first step."""
    console = Console(stderr=True, soft_wrap=True)
    failed = [(number, step) for number, step in enumerate(steps, start=first) if not step.converged]
    for number, step in failed[:MOST_LINES]:
        text = f"step {number}, t = {step.time:.4g} s, did not converge: {step.message}"
        console.print(text, style="red", markup=False, highlight=False)
    if len(failed) > MOST_LINES:
        console.print(f"and {len(failed) - MOST_LINES} more", style="red")

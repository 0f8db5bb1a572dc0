# SPDX-License-Identifier: Apache-2.0
"""Summary of the steps of a run that did not converge: number, time and reason."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from gdfe_ros.terminal import PlainConsole

MOST_LINES = 3
"""Largest number of steps that are listed individually."""


class StepOutcome(Protocol):
    """Outcome of a step, as in results and step records."""

    @property
    def converged(self) -> bool:
        """Whether the step reached its tolerance."""

    @property
    def time(self) -> float:
        """Simulation time [s]."""

    @property
    def message(self) -> str:
        """Reason why the step did not converge."""


def convergence(steps: Sequence[StepOutcome]) -> str:
    """Return ``yes``, or the number of steps that did not converge: ``no: 3 of 100 steps``."""
    failed = sum(not step.converged for step in steps)
    return f"no: {failed} of {len(steps)} steps" if failed else "yes"


def print_failures(steps: Sequence[StepOutcome], *, first: int = 1) -> None:
    """Print each step that did not converge to stderr: number, time, reason; ``first`` is the first step's number."""
    console = PlainConsole(stderr=True, soft_wrap=True)
    failed = [(number, step) for number, step in enumerate(steps, start=first) if not step.converged]
    for number, step in failed[:MOST_LINES]:
        text = f"step {number}, t = {step.time:.4g} s, did not converge: {step.message}"
        console.print(text, style="red", highlight=False)
    if len(failed) > MOST_LINES:
        console.print(f"and {len(failed) - MOST_LINES} more", style="red")

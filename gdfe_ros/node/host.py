# SPDX-License-Identifier: Apache-2.0
"""What the stepper and the drive ask of whoever owns the simulation: the node's run, or a live view's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from gdfe_ros.node.refusals import RefusalLog
from gdfe_ros.node.step import Step
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Simulation


class Settings(Protocol):
    """Values in force by name, those of the node: `dt`, `velocity_timeout`, `slew_time`, `deadline`, `cut_after`."""

    def __getitem__(self, name: str) -> Any:
        """Give a value."""


class Host(Protocol):
    """Owns a simulation that is stepped.

    Attributes:
        simulation: touched by the stepping thread only; another one after a change of moduli.
        scene: that is simulated.
        parameters: values in force.
        refusals: counts refused commands.
        last: the step made last, or None.
        log_time: of that step, for the bag [ns]; it never goes back.
    """

    simulation: Simulation
    parameters: Settings | Mapping[str, Any]
    refusals: RefusalLog
    last: Step | None
    log_time: int

    @property
    def scene(self) -> Scene:
        """The scene that is simulated."""

    def report(self, text: str) -> None:
        """Take the text of an error that somebody should read."""

    def stamp(self, ending: float, early: float = 0.0) -> int:
        """Give the stamp [ns] of a step that ends at a simulation time [s], ``early`` [s] before another's clock."""

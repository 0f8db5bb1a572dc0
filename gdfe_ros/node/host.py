# SPDX-License-Identifier: Apache-2.0
"""Interface through which the stepping thread uses the owner of a simulation: a node's run or a live session."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from gdfe_ros.node.refusals import RefusalLog
from gdfe_ros.recording.step import Step
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Simulation


class Settings(Protocol):
    """Present parameter values by name, as in the node: `dt`, `velocity_timeout`, `slew_time`, `deadline`, ..."""

    def __getitem__(self, name: str) -> Any:
        """Return the present value of a parameter."""


class Host(Protocol):
    """Owner of a simulation that is stepped.

    Attributes:
        simulation: present simulation, used by the stepping thread only; replaced after a change of moduli.
        scene: scene of the simulation.
        parameters: present parameter values by name.
        refusals: counts of refused commands.
        last: the last step, or None.
        log_time: log time of the last step in the bag [ns]; it never goes back.
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
        """Report an error message to the user."""

    def stamp(self, ending: float, early: float = 0.0) -> int:
        """Return the stamp [ns] of a step that ends at the simulation time ``ending`` [s].

        ``early`` [s] is the time by which this end precedes the present time of an external clock.
        """

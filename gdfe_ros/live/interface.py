# SPDX-License-Identifier: Apache-2.0
"""What a page asks of a run: of a simulation in this process, or of a node somewhere else."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Future
from enum import Enum
from typing import Any, Protocol

from gdfe_ros.constraints import Pose
from gdfe_ros.node.orders import Order
from gdfe_ros.scene.scene import Scene


class Ability(str, Enum):
    """What can be asked of a run beside commands; there is a button for each."""

    PLAY = "play the program"
    PAUSE = "pause"
    STEP = "one step"
    RESET = "reset"
    RECORD = "record"
    MODULI = "change the body"


class Session(Protocol):
    """A run that is shown and commanded.

    Attributes:
        abilities: what can be asked of it; nothing else is.
        failure: why it ended by itself, or None.
    """

    abilities: frozenset[Ability]
    failure: Exception | None

    @property
    def title(self) -> str:
        """What is shown."""

    @property
    def scene(self) -> Scene:
        """The scene that is simulated."""

    @property
    def commands(self) -> Mapping[str, float]:
        """Commands in force of actuators and loads; without those that are not known."""

    @property
    def targets(self) -> Mapping[str, Pose]:
        """Targets in force of handles and obstacles, relative to rest."""

    @property
    def moduli(self) -> Mapping[str, float]:
        """Young's moduli in force [Pa] by material; without those that cannot be changed."""

    @property
    def paused(self) -> bool:
        """Whether only `ask` for a step makes one."""

    @property
    def recording(self) -> str | None:
        """The bag that is written, or None."""

    def watch(self, wanted: bool) -> None:
        """Take note of whether anybody looks."""

    def doing(self) -> tuple[str, bool]:
        """Say what it does and whether that is bad; nothing where the last steps tell it."""

    def command(self, name: str, order: Order) -> None:
        """Give an order to the next step.

        Raises:
            GdfeError: it cannot be carried out.
        """

    def ask(self, ability: Ability) -> Future[str] | None:
        """Do what a button asks for, but for moduli; where it pauses or records already, the opposite.

        The answer is a text for the user, or raises a GdfeError; None where the page shows what was done.
        """

    def set_moduli(self, moduli: Mapping[str, float]) -> Future[Any]:
        """Give materials other Young's moduli [Pa]; with the ability only. The answer may raise a GdfeError."""

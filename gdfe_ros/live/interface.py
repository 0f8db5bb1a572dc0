# SPDX-License-Identifier: Apache-2.0
"""Interface of a run to a page: a simulation in this process, or a node in another."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Future
from enum import Enum
from typing import Any, Protocol

from gdfe_ros.constraints import Pose
from gdfe_ros.node.orders import Order
from gdfe_ros.scene.scene import Scene


class Ability(str, Enum):
    """Request to a run other than a command; there is a button for each."""

    PLAY = "play the program"
    PAUSE = "pause"
    STEP = "one step"
    RESET = "reset"
    RECORD = "record"
    MODULI = "change the body"


class ShownRun(Protocol):
    """A run that is drawn and commanded.

    Attributes:
        abilities: the supported requests.
        failure: reason if the run ended without a request; None otherwise.
    """

    abilities: frozenset[Ability]
    failure: Exception | None

    @property
    def title(self) -> str:
        """Title of the page."""

    @property
    def scene(self) -> Scene:
        """The scene of the simulation."""

    @property
    def commands(self) -> Mapping[str, float]:
        """Present commands of actuators and loads; unknown ones are left out."""

    @property
    def targets(self) -> Mapping[str, Pose]:
        """Present targets of handles and obstacles, relative to rest."""

    @property
    def moduli(self) -> Mapping[str, float]:
        """Present Young's moduli [Pa] by material; moduli that cannot be changed are left out."""

    @property
    def paused(self) -> bool:
        """Whether steps are made only on request."""

    @property
    def recording(self) -> str | None:
        """Path of the bag that is being written, or None."""

    def watch(self, wanted: bool) -> None:
        """Record whether there are viewers."""

    def doing(self) -> tuple[str, bool]:
        """Return a text about the run's activity, and whether it is a problem; empty if the last steps show it."""

    def command(self, name: str, order: Order) -> None:
        """Queue an order for the next step.

        Raises:
            GdfeError: the order cannot be carried out.
        """

    def ask(self, ability: Ability) -> Future[str] | None:
        """Carry out the request of any button except the one of the moduli; `pause` and `record` are toggles.

        Return a future text for the user, which may raise a GdfeError, or None if the page itself shows the effect.
        """

    def set_moduli(self, moduli: Mapping[str, float]) -> Future[Any]:
        """Set Young's moduli [Pa] of materials, if that is among the abilities. The answer may raise a GdfeError."""

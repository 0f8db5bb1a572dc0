# SPDX-License-Identifier: Apache-2.0
"""Interface between a page and the run that it shows: a simulation in this process, or a node in another process."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Future
from enum import Enum
from typing import Any, Protocol

from gdfe_ros.constraints import Pose
from gdfe_ros.node.orders import Order
from gdfe_ros.scene.scene import Scene


class Ability(str, Enum):
    """Request to a run that is not a command; the page has a button for each request."""

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
        failure: exception that ended the run; None if there was none.
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
        """Present commands of actuators, loads and joints, by name; unknown commands are left out."""

    @property
    def targets(self) -> Mapping[str, Pose]:
        """Present targets of handles and obstacles by name, relative to rest."""

    @property
    def moduli(self) -> Mapping[str, float]:
        """Present Young's moduli [Pa] by material, of the materials with such a modulus."""

    @property
    def paused(self) -> bool:
        """Whether steps are made only on request."""

    @property
    def recording(self) -> str | None:
        """Path of the bag that is being written, or None."""

    def watch(self, wanted: bool) -> None:
        """Inform the run whether there are viewers."""

    def doing(self) -> tuple[str, bool]:
        """Return a text about the run's activity, and whether it is a problem; empty while it only makes steps."""

    def command(self, name: str, order: Order) -> None:
        """Queue an order for the next step.

        Raises:
            GdfeError: the order cannot be carried out.
        """

    def ask(self, ability: Ability) -> Future[str] | None:
        """Carry out a request other than ``MODULI``; ``PAUSE`` and ``RECORD`` are toggles.

        Return a ``Future``, which has a text for the user or raises a GdfeError. Return None if the page itself shows
        the effect.
        """

    def set_moduli(self, moduli: Mapping[str, float]) -> Future[Any]:
        """Set Young's moduli [Pa] by material, if ``MODULI`` is supported; the ``Future`` may raise a GdfeError."""

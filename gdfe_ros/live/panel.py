# SPDX-License-Identifier: Apache-2.0
"""What can be pressed, slid and typed: one control for each actuator, load and modulus, and the buttons of the run."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from time import monotonic
from typing import Any

import viser

from gdfe_ros.actuators import Actuator
from gdfe_ros.live.session import LiveSession
from gdfe_ros.node.interface.parameters import MODULUS
from gdfe_ros.node.orders import ActuatorOrder
from gdfe_ros.node.remodelling import moduli_of

_TOUCHED = 1.0
"""Time after a move during which a slider is the user's [s]; then it shows the command in force."""
_LARGEST_FACTOR = 2.0
"""At the right end of a load's slider."""
_STEPS = 1000
"""Between the ends of a slider."""


class Panel:
    """The controls of a run; what viewers do to them goes through the session's inbox.

    Args:
        gui: of the page.
        session: that is commanded.
        say: shows a text to every viewer.
        guarded: wraps what may raise a GdfeError, which is then shown.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        session: LiveSession,
        *,
        say: Callable[[str], None],
        guarded: Callable[[Callable[[], Any]], None],
    ) -> None:
        self._gui, self._session, self._say, self._guarded = gui, session, say, guarded
        self._sliders: dict[str, _Slider] = {}
        self._add_buttons()
        scene = session.scene
        if scene.actuators or scene.loads:
            with gui.add_folder("Commands"):
                for actuator in scene.actuators:
                    self._add_actuator(actuator)
                for load in scene.loads:
                    self._add_input(load.name, f"{load.name}, factor [1]", 0.0, _LARGEST_FACTOR)
        self._add_moduli()

    def refresh(self, commands: Mapping[str, float]) -> None:
        """Show the commands in force, and what the buttons would do."""
        for name, slider in self._sliders.items():
            slider.show(commands[name])
        self._hold.label = "go on" if self._session.stepper.paused else "pause"
        self._bag.label = "record" if self._session.recording is None else "finish the bag"

    def _add_buttons(self) -> None:
        session, scene = self._session, self._session.scene
        actions = {
            "play": ("play the program", session.play),
            "hold": ("pause", lambda: session.pause(not session.stepper.paused)),
            "step": ("one step", session.advance),
            "reset": ("reset", session.reset),
            "bag": ("record", self._switch_bag),
        }
        made = {key: self._add_button(label, action) for key, (label, action) in actions.items()}
        made["play"].disabled = scene.program is None
        self._hold, self._bag = made["hold"], made["bag"]

    def _add_button(self, label: str, action: Callable[[], Any]) -> viser.GuiButtonHandle:
        button = self._gui.add_button(label)

        @button.on_click
        async def _(event: viser.GuiEvent) -> None:
            self._guarded(action)

        return button

    def _switch_bag(self) -> None:
        path = None
        if self._session.recording is None:
            path = Path("runs") / f"{self._session.scene.name}_{datetime.now():%Y%m%d_%H%M%S_%f}"
        self._session.record(path).add_done_callback(lambda answer: self._guarded(lambda: self._say(answer.result())))

    def _add_actuator(self, actuator: Actuator) -> None:
        label = f"{actuator.name}, {actuator.mode.value} [{actuator.mode.unit or 1}]"
        self._add_input(actuator.name, label, actuator.low, actuator.high)

    def _add_input(self, name: str, label: str, low: float, high: float) -> None:
        """Add a slider from end to end or, where a range has none, a number."""
        start = self._session.simulation.commands[name]
        if math.isfinite(high - low):
            step = (high - low) / _STEPS
            control = self._gui.add_slider(
                label, min=low, max=high, step=step, initial_value=min(max(start, low), high)
            )
        else:
            ends = {"min": low if math.isfinite(low) else None, "max": high if math.isfinite(high) else None}
            control = self._gui.add_number(label, initial_value=start, step=1e-3, **ends)
        slider = self._sliders[name] = _Slider(control)

        @control.on_update
        async def _(event: viser.GuiEvent) -> None:
            if event.client is None:  # `refresh` has shown a command, nobody gave one
                return
            slider.touched = monotonic()
            self._guarded(lambda: self._session.command(name, ActuatorOrder({name: float(control.value)})))

    def _add_moduli(self) -> None:
        """Add a number for each modulus, and the button that has the body take them."""
        moduli = moduli_of(self._session.scene)
        if not moduli:
            return
        with self._gui.add_folder("Young's moduli", expand_by_default=False):
            numbers = {
                name: self._gui.add_number(f"{name} [Pa]", young, min=MODULUS.least, max=MODULUS.most, step=1.0)
                for name, young in moduli.items()
            }
            self._add_button("change the body", lambda: self._change_moduli(numbers))

    def _change_moduli(self, numbers: Mapping[str, viser.GuiNumberHandle]) -> None:
        present = moduli_of(self._session.scene)
        wanted = {name: float(number.value) for name, number in numbers.items() if number.value != present[name]}
        if not wanted:
            self._say("the body has these moduli already")
            return
        answer = self._session.set_moduli(wanted)
        answer.add_done_callback(lambda done: self._guarded(done.result))


@dataclass
class _Slider:
    """A control of a command.

    Attributes:
        control: of viser.
        touched: when a viewer moved it last (monotonic) [s].
    """

    control: Any
    touched: float = field(default=-math.inf)

    def show(self, value: float) -> None:
        """Show a command in force, where no viewer is at it."""
        if monotonic() - self.touched > _TOUCHED:
            self.control.value = value

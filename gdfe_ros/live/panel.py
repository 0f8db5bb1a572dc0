# SPDX-License-Identifier: Apache-2.0
"""Controls of the page, and the status as text."""

from __future__ import annotations

import html
import math
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from time import monotonic
from typing import Any

import viser

from gdfe_ros.live.interface import Ability, ShownRun, View
from gdfe_ros.node.driving.orders import ActuatorOrder
from gdfe_ros.node.interface import MODULUS

_TOUCHED = 1.0
"""After a viewer's move, a slider shows the viewer's value for this time [s]; then it shows the present command."""
_LARGEST_FACTOR = 2.0
"""Value at the right end of a load's slider."""
_STEPS = 1000
"""Number of steps of a slider."""


class Panel:
    """The controls of a run; viewers' actions become orders and requests to the session.

    Args:
        gui: controls of the page.
        session: commanded run.
        say: function that shows a text to every viewer.
        guard: function that carries out an action and shows its GdfeError to every viewer.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        session: ShownRun,
        *,
        say: Callable[[str], None],
        guard: Callable[[Callable[[], Any]], None],
    ) -> None:
        self._gui, self._session, self._say, self._guard = gui, session, say, guard
        self._sliders: dict[str, _Slider] = {}
        self._buttons: dict[Ability, viser.GuiButtonHandle] = {}
        self._moduli = dict(session.moduli)
        self._numbers: dict[str, viser.GuiNumberHandle[float]] = {}
        for ability in Ability:
            if ability in session.abilities and ability is not Ability.MODULI:
                self._add_button(ability, lambda ability=ability: session.ask(ability))
        scene = session.scene
        if scene.actuators or scene.loads or scene.arms:
            with gui.add_folder("Commands"):
                for actuator in scene.actuators:
                    label = f"{actuator.name}, {actuator.mode.value} [{actuator.mode.unit or 1}]"
                    self._add_input(actuator.name, label, actuator.low, actuator.high)
                for load in scene.loads:
                    self._add_input(load.name, f"{load.name}, factor [1]", 0.0, _LARGEST_FACTOR)
                for joint in (joint for arm in scene.arms for joint in arm.joints):
                    self._add_input(joint.name, f"{joint.name} [{joint.unit}]", joint.limits.lower, joint.limits.upper)
        self._add_moduli()

    def refresh(self, commands: Mapping[str, float]) -> None:
        """Show the present commands and the effects of the buttons."""
        for name, slider in self._sliders.items():
            slider.show(commands.get(name))
        self._show_moduli()
        self._label(Ability.PAUSE, "go on" if self._session.paused else "pause")
        self._label(Ability.RECORD, "record" if self._session.recording is None else "finish the bag")

    def _add_button(self, ability: Ability, action: Callable[[], Future[Any] | None]) -> None:
        button = self._buttons[ability] = self._gui.add_button(ability.value)

        @button.on_click
        async def _(event: viser.GuiEvent) -> None:
            self._guard(lambda: self._await(action()))

    def _await(self, answer: Future[Any] | None) -> None:
        """Show the text or the error of a ``Future`` to viewers once it is complete."""

        def tell(done: Future[Any]) -> None:
            if text := done.result():
                self._say(text)

        if answer is not None:
            answer.add_done_callback(lambda done: self._guard(lambda: tell(done)))

    def _label(self, ability: Ability, text: str) -> None:
        if ability in self._buttons:
            self._buttons[ability].label = text

    def _add_input(self, name: str, label: str, low: float, high: float) -> None:
        """Add a slider from ``low`` to ``high`` or, if the range is unbounded, a number field."""
        start = self._session.commands.get(name, min(max(0.0, low), high))
        if math.isfinite(high - low):
            step = (high - low) / _STEPS
            control = self._gui.add_slider(
                label, min=low, max=high, step=step, initial_value=min(max(start, low), high)
            )
        else:
            ends = {"min": low if math.isfinite(low) else None, "max": high if math.isfinite(high) else None}
            control = self._gui.add_number(label, initial_value=start, step=1e-3, **ends)
        slider = self._sliders[name] = _Slider(control, label)

        @control.on_update
        async def _(event: viser.GuiEvent) -> None:
            if event.client is None:  # set by `refresh`, not by a viewer
                return
            slider.touched = monotonic()
            self._guard(lambda: self._session.command(name, ActuatorOrder({name: float(control.value)})))

    def _add_moduli(self) -> None:
        """Add a number field for each modulus, and the button that applies the numbers."""
        if not self._moduli or Ability.MODULI not in self._session.abilities:
            return
        with self._gui.add_folder("Young's moduli", expand_by_default=False):
            self._numbers = {
                name: self._gui.add_number(f"{name} [Pa]", young, min=MODULUS.least, max=MODULUS.most, step=1.0)
                for name, young in self._moduli.items()
            }
            self._add_button(Ability.MODULI, self._change_moduli)

    def _show_moduli(self) -> None:
        """Show the moduli that have changed since they were last shown.

        All other fields are kept, because a viewer may have typed a number.
        """
        present = self._session.moduli
        for name, number in self._numbers.items():
            if present[name] != self._moduli[name]:
                self._moduli[name] = number.value = present[name]

    def _change_moduli(self) -> Future[Any] | None:
        present = self._session.moduli
        wanted = {name: float(number.value) for name, number in self._numbers.items() if number.value != present[name]}
        if wanted:
            return self._session.set_moduli(wanted)
        self._say("the body has these moduli already")
        return None


@dataclass
class _Slider:
    """The slider or number field of a command.

    Attributes:
        control: element of viser's page.
        label: text of the control.
        touched: time of the last move by a viewer, on a monotonic clock [s].
    """

    control: Any
    label: str
    touched: float = field(default=-math.inf)

    def show(self, value: float | None) -> None:
        """Show the present command, unless a viewer has just moved the slider; None: the command is unknown."""
        self.control.label = self.label if value is not None else f"{self.label}, not known"
        if value is None or monotonic() - self.touched <= _TOUCHED:
            return
        if isinstance(self.control, viser.GuiSliderHandle):
            # Another client may command a load factor beyond the slider's ends.
            if value < self.control.min:
                self.control.min = value
            if value > self.control.max:
                self.control.max = value
        self.control.value = value


_WINDOW = 1.0
"""Duration over which rates are averaged, in wall time [s]."""


class Status:
    """Reports the status of a session.

    Args:
        session: the running session.
    """

    def __init__(self, session: ShownRun) -> None:
        self._session = session
        self._times: deque[tuple[float, float, int]] = deque(maxlen=10_000)

    def add(self, view: View) -> None:
        """Add a step; called in the thread that makes or receives it."""
        now = monotonic()
        if self._times and view.record.time < self._times[-1][1]:
            self._times.clear()
        self._times.append((now, view.record.time, view.record.step))
        while len(self._times) > 2 and self._times[0][0] < now - _WINDOW:
            self._times.popleft()

    def text(self, view: View | None, *, largest: Mapping[str, float], viewers: int) -> str:
        """Return the status as HTML.

        Args:
            view: the last step, or None.
            largest: dict from a group of arrows to the largest of its forces [N].
            viewers: number of connected browsers.
        """
        rows = {"state": self._doing()} if view is None else self._rows(view, largest, viewers)
        if self._session.recording is not None:
            rows["recording"] = html.escape(str(self._session.recording))
        return _table(rows)

    def _rows(self, view: View, largest: Mapping[str, float], viewers: int) -> dict[str, str]:
        record, pace = view.record, self._pace()
        return {
            "state": self._doing(),
            "time": f"{record.time:.3f} s" + (f", {pace[1]:.0f} steps/s" if pace else ""),
            "real time": f"&times; {pace[0]:.2f}" if pace else "-",
            "solve": f"{record.iterations} iterations, error estimate {record.error_estimate:.1e}",
            "converged": "yes" if record.converged else _bad(f"no: {record.message}"),
            "least det F": f"{record.min_det:.3f}",
            **{f"largest of {name}": f"{force:.3g} N" for name, force in largest.items()},
            "viewers": str(viewers),
        }

    def _pace(self) -> tuple[float, float] | None:
        """Return simulation time divided by wall time, and steps per second, in the last second; None without steps."""
        times = list(self._times)
        if len(times) < 2 or times[-1][0] < monotonic() - _WINDOW:
            return None
        (begun, first, number), (ended, last, latest) = times[0], times[-1]
        wall = max(ended - begun, 1e-9)
        return (last - first) / wall, (latest - number) / wall

    def _doing(self) -> str:
        text, bad = self._session.doing()
        text = text or ("at rest, waits for commands" if self._pace() is None else "follows commands")
        return _bad(text) if bad else html.escape(text)


def waiting(text: str) -> str:
    """Return the status of a page whose run is still being built, as HTML."""
    return _table({"state": html.escape(text)})


def _table(rows: Mapping[str, str]) -> str:
    cells = "".join(f"<tr><td>{name}</td><td>{text}</td></tr>" for name, text in rows.items())
    return f'<table id="status" style="font-size:0.8em;line-height:1.3;width:100%;padding:0 0.8em">{cells}</table>'


def _bad(text: str) -> str:
    return f'<span style="color:#c22">{html.escape(text)}</span>'

# SPDX-License-Identifier: Apache-2.0
"""The page: a server for browsers, and the thread that draws finished steps at a limited frame rate."""

from __future__ import annotations

import contextlib
import errno
import io
import logging
import socket
import sys
import threading
from collections.abc import Callable, Mapping
from time import monotonic
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from gdfe_ros.errors import GdfeError
from gdfe_ros.live.gate import Admission, Gate, guarding
from gdfe_ros.live.interface import ShownRun, View
from gdfe_ros.live.leading import Leading
from gdfe_ros.live.panel import Panel, Status, waiting
from gdfe_ros.live.plots import Plots, StepHistory
from gdfe_ros.live.stage import Stage
from gdfe_ros.live.surface import Range, fields_of, legend
from gdfe_ros.node.driving.orders import Order
from gdfe_ros.scene.scene import Scene
from gdfe_ros.threads import VIEWER, show_name
from gdfe_ros.untrusted.bounded_text import Throttle, plain_lines

_SLOWLY = 0.2
"""Update interval of numbers, plots, traces and sliders [s]. The body and its markers are updated in every frame."""
_BUILT = "the body is being built"
_PLAIN = "none"
"""Choice of a body without colours."""
_PORTS = 65536
_LONGEST_NOTE = 300
"""Largest number of characters of a text for viewers."""


class Page:
    """Draws a session in browsers and lets viewers command it.

    The solver never waits for the page. The drawing thread draws the last finished step and skips earlier ones, and
    slow viewers receive the newest frame when they are ready.

    Args:
        host: address of the server, e.g. ``127.0.0.1``.
        port: first port to try; if it is in use, the following ports are tried.
        frames: largest number of frames per second.
        gate: admits the requests of viewers; None: a new one, with a random token.

    Raises:
        GdfeError: the host is not an address of this machine, or no port is free.

    Attributes:
        port: port of the server.
        gate: admits the requests of viewers.
        drawn: number of frames drawn so far.
        faults: number of frames that could not be drawn; the drawing goes on with the next frame.
    """

    def __init__(self, *, host: str, port: int, frames: float, gate: Gate | None = None) -> None:
        _shorten_complaints()
        self._interval, self.drawn, self.faults = 1.0 / frames, 0, 0
        self.gate, self._told = gate or Gate(), Throttle()
        port = _free_port(host, port)
        with contextlib.redirect_stdout(io.StringIO()), guarding(self.gate):  # the command prints the address
            self._server = viser.ViserServer(host=host, port=port, verbose=False)
        self._admission = Admission(self._server, self._say_seldom)
        self.port = self._server.get_port()
        self._changed, self._ending = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._work, name=VIEWER, daemon=True)
        self._session: ShownRun | None = None
        self._leading: Leading | None = None
        self._early = False
        self._stage: Stage | None = None
        self._view: View | None = None
        self._seen: View | None = None
        self._again = True

    @property
    def viewers(self) -> int:
        """Number of connected browsers."""
        return len(self._server.get_clients())

    def address(self, host: str = "localhost") -> str:
        """Return the address of the page with its token, for a browser that reaches this machine as ``host``."""
        return f"http://{host}:{self.port}/?token={self.gate.token}"

    def lay_out(self, scene: Scene, title: str) -> None:
        """Draw the undeformed body of a scene while its run is still being built."""
        gui = self._server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        gui.set_panel_label(f"gdfe live: {title}")
        self._fields, self._range = fields_of(scene), Range()
        self._stage = Stage(self._server, scene, dragged=self._lead, aimed=self._aim)
        self._side = gui.add_panel()
        with self._side.add_tab("State"):
            self._legend, self._state = gui.add_html(""), gui.add_html(waiting(_BUILT))
        gui.main_panel.dock_right()
        self._side.dock_left()
        self._side.set_width(330)

        @self._server.on_client_connect
        async def _(client: viser.ClientHandle) -> None:
            self._admission.welcome(client)
            self._look_again()

    def show(self, session: ShownRun) -> None:
        """Connect a session to the page, and begin to draw the steps that `take` receives."""
        if self._stage is None:
            self.lay_out(session.scene, session.title)
        gui = self._server.gui
        self._history = StepHistory(session.scene)
        self._status = Status(session)
        self._session = session
        self._leading = Leading(session, self.say)
        self._panel = Panel(gui, session, say=self.say, guard=self._guard)
        self._add_looks()
        self._plots = Plots(gui, self._history, below=self._side)
        self._thread.start()

    def show_view(self, view: View) -> None:
        """Store a step, to be drawn with the next frame; called in the thread that makes or receives the step."""
        self._history.add(view)
        self._status.add(view)
        self._view = view
        if self._leading is not None:
            self._leading.send_next(view)
        self._changed.set()

    def compare(
        self,
        places: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]],
        body: Callable[[NDArray[np.floating]], NDArray[np.float64]] | None = None,
    ) -> None:
        """Draw measured points beside simulated ones, with their distance.

        Args:
            places: dict from name to measured and simulated position, each (3,) [m].
            body: function that returns positions of the measured body from positions of the simulated body, both (n, 3)
                [m]; the measured body is drawn translucent. None: only points are drawn.
        """
        drawn = None if body is None or self._view is None else body(self._view.positions)
        with self._server.atomic():
            self._stage.compare(places, drawn)

    def say(self, text: str) -> None:
        """Show a text to every viewer and on the terminal."""
        print(plain_lines(text), file=sys.stderr)
        for client in self._server.get_clients().values():
            client.add_notification("gdfe live", text[:_LONGEST_NOTE], auto_close_seconds=10.0)

    def close(self) -> None:
        """End the drawing and the server."""
        self._ending.set()
        self._changed.set()
        if self._thread.is_alive():
            self._thread.join()
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def _add_looks(self) -> None:
        """Add the controls for the appearance of the body."""
        gui = self._server.gui
        with gui.add_folder("Look", expand_by_default=False):
            self._colour = gui.add_dropdown("colour", (*self._fields, _PLAIN))
            held = gui.add_checkbox("hold the range", False)
            groups = {name: gui.add_checkbox(name, True) for name in self._stage.groups}

        @self._colour.on_update
        async def _(event: viser.GuiEvent) -> None:
            self._range.held = held.value = False
            self._look_again()

        @held.on_update
        async def _(event: viser.GuiEvent) -> None:
            self._range.held = held.value
            self._look_again()

        for name, box in groups.items():

            @box.on_update
            async def _(event: viser.GuiEvent, name: str = name) -> None:
                self._stage.show(name, event.target.value)
                self._look_again()

    def _lead(self, name: str, order: Order) -> None:
        if self._session is None:
            if not self._early:
                self.say(_BUILT)
            self._early = True
        else:
            self._guard(lambda: self._session.command(name, order))

    def _aim(self, probe: str, goal: NDArray[np.float64]) -> None:
        if self._leading is not None:
            self._guard(lambda: self._leading.set_goal(probe, goal))

    def _look_again(self) -> None:
        """Request a new drawing of the present step."""
        self._again = True
        self._changed.set()

    def _guard(self, action: Callable[[], Any]) -> None:
        try:
            action()
        except GdfeError as error:
            self.say(str(error))

    def _work(self) -> None:
        """Draw new steps until the end; a fault in drawing is counted and reported, and the next frame is drawn."""
        show_name()
        slow = due = 0.0
        while not self._ending.is_set():
            self._changed.wait(_SLOWLY)
            self._changed.clear()
            started = monotonic()
            try:
                slow = self._show_step(slow, started)
            except Exception as error:
                self.faults += 1
                self._say_seldom("drawing", f"a frame cannot be drawn: {error!r}")
                slow = started
            due = max(due + self._interval, started)  # compensates for the time spent waiting for a step
            self._ending.wait(max(0.0, due - monotonic()))

    def _show_step(self, slow: float, now: float) -> float:
        """Draw the last step if there are viewers; return the time of the last update of numbers, plots and traces."""
        view, again = self._view, self._again
        self._session.watch(bool(self.viewers))
        if not self.viewers:
            return slow
        if view is not None and (view is not self._seen or again):
            self._seen, self._again = view, False
            self._draw(view)
            self._ending.wait(self._interval / 2)  # meanwhile the browser reads the frame
            self._stage.body.turn()
            self._server.flush()
            self.drawn += 1
        if now - slow < _SLOWLY:
            return slow
        self._refresh(view)
        return now

    def _say_seldom(self, subject: str, text: str) -> None:
        """Show a text at most once in five seconds for each subject, because there may be thousands of texts."""
        if (more := self._told.due(subject)) is not None:
            self.say(text + more)

    def _draw(self, view: View) -> None:
        """Send the frame of a step at once; viser would wait for 1/60 s to collect messages."""
        shares = None
        if self._colour.value != _PLAIN:
            field = self._fields[self._colour.value]
            shares = self._range.shares(field.values(view, self._stage.surface), noise=field.noise)
        with self._server.atomic():
            self._stage.body.fill(self._stage.surface.pack(view.positions, shares))
            self._stage.mark(view)
        self._server.flush()

    def _refresh(self, view: View | None) -> None:
        """Update the parts that are not in every frame; before the first step, update only controls and status."""
        with self._server.atomic():
            self._panel.refresh(self._session.commands)
            self._state.content = self._status.text(view, largest=self._stage.largest(), viewers=self.viewers)
            if view is None:
                return
            self._stage.trace()
            self._stage.lead(self._session.targets)
            self._legend.content = "" if self._colour.value == _PLAIN else legend(self._colour.value, self._range)
            self._plots.refresh()


def _free_port(host: str, first: int) -> int:
    """Return the first free port of an address, from ``first`` on.

    Raises:
        GdfeError: the host is not an address of this machine, or no port is free.
    """
    for port in range(first, _PORTS):
        try:
            with socket.create_server((host, port)):
                return port
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                text = f"port {port} of {host!r} cannot be opened: {error.strerror}; allowed: an address of this "
                raise GdfeError(f"{text}machine, 127.0.0.1 for itself alone, 0.0.0.0 for its network") from error
    raise GdfeError(f"no port from {first} to {_PORTS - 1} is free")


def _shorten_complaints() -> None:
    """Make libraries log invalid connections in one line, without a traceback."""
    for name in ("websockets.server", "asyncio"):
        logger = logging.getLogger(name)
        if not any(isinstance(each, _OneLine) for each in logger.filters):
            logger.addFilter(_OneLine())


class _OneLine(logging.Filter):
    """Replaces an exception's traceback by its text, and lets each text pass once in five seconds."""

    def __init__(self) -> None:
        super().__init__()
        self._throttle = Throttle()

    def filter(self, record: logging.LogRecord) -> bool:
        """Shorten a log record; return False if the same text was logged in the last five seconds."""
        error = record.exc_info[1] if record.exc_info else None
        text = record.getMessage().partition("\n")[0] + (f": {error!r}" if error else "")
        record.msg, record.args = f"gdfe live: {text[:_LONGEST_NOTE]}", ()
        record.exc_info = record.exc_text = None
        return self._throttle.due(record.getMessage()) is not None

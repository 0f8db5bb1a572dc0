# SPDX-License-Identifier: Apache-2.0
"""Status of the run, in a few lines that are always visible."""

from __future__ import annotations

import html
from collections import deque
from collections.abc import Mapping
from time import monotonic

from gdfe_ros.live.interface import ShownRun
from gdfe_ros.live.view import View

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

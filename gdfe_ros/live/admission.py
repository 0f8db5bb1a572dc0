# SPDX-License-Identifier: Apache-2.0
"""Which messages a viewer may send: each is checked against the control that it changes, and else refused.

viser itself trusts its clients: it would set any attribute of a control to any value, and open a public tunnel on
request.
"""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable, Iterable
from typing import Any

import viser
from viser import _messages as messages

_FARTHEST = 1e6
"""Largest coordinate of a dragged control, in the units of the view, in which the body's size is about 1."""

Handler = Callable[[int, Any], Awaitable[None] | None]


class Admission:
    """Lets only harmless messages of viewers reach viser.

    Args:
        server: viser's server.
        refuse: function that receives the subject and the reason of each refusal; there are few subjects.
    """

    def __init__(self, server: viser.ViserServer, refuse: Callable[[str, str], None]) -> None:
        self._gui, self._refuse = server.gui, refuse
        checks: dict[type, Callable[[Any], str]] = {
            messages.GuiUpdateMessage: self._wrong_update,
            messages.TransformControlsUpdateMessage: _wrong_pose,
            messages.TransformControlsDragStartMessage: _allow,
            messages.TransformControlsDragEndMessage: _allow,
        }
        # viser has no interface for this.
        handlers = server._websock_server._incoming_handlers
        for kind in list(handlers):
            if kind in checks:
                handlers[kind] = [self._checked(handler, checks[kind]) for handler in handlers[kind]]
            else:
                del handlers[kind]

    def welcome(self, client: viser.ClientHandle) -> None:
        """Let a new viewer send, for itself alone, nothing but the place of its camera."""
        handlers = client._websock_connection._incoming_handlers
        for kind in set(handlers) - {messages.ViewerCameraMessage}:
            del handlers[kind]

    def _checked(self, handler: Handler, wrong: Callable[[Any], str]) -> Handler:
        async def handle(client: int, message: Any) -> None:
            try:
                reason = wrong(message)
            except Exception as error:  # a message may have any content
                reason = f"a message cannot be read: {error!r}"
            if reason:
                uuid = getattr(message, "uuid", None)
                subject = self._gui._gui_input_handle_from_uuid.get(uuid) if isinstance(uuid, str) else None
                self._refuse(f"{type(message).__name__} {getattr(subject, 'label', '')}", reason)
                if isinstance(subject, viser.GuiInputHandle):
                    self._put_back(subject)
                return
            answer = handler(client, message)
            if answer is not None:
                await answer

        return handle

    def _put_back(self, subject: Any) -> None:
        """Send the value of a control to the viewers; assigning it would send nothing, because it has not changed."""
        values = {"value": subject.value}
        self._gui._websock_interface.queue_message(messages.GuiUpdateMessage(subject._impl.uuid, values))

    def _wrong_update(self, message: Any) -> str:
        """Return why a control cannot get the values of a message; empty if it can. Only its value can change."""
        handle = self._gui._gui_input_handle_from_uuid.get(message.uuid)
        if handle is None:
            return ""  # removed meanwhile; viser ignores the message
        if not isinstance(message.updates, dict) or set(message.updates) != {"value"}:
            return f"a viewer may change only the value of a control, not {_shown(message.updates)}"
        label, value = getattr(handle, "label", "a control"), message.updates["value"]
        return f"{label}: {reason}" if (reason := _wrong_value(handle, value)) else ""


def _wrong_value(handle: Any, value: Any) -> str:
    """Return why a value is not one of a control; empty if it is."""
    match handle:
        case viser.GuiButtonHandle() | viser.GuiCheckboxHandle():
            return "" if isinstance(value, bool) else f"{_shown(value)} is given; allowed: true, false"
        case viser.GuiDropdownHandle():
            good = isinstance(value, str) and value in handle.options
            return "" if good else f"{_shown(value)} is given; allowed: {', '.join(handle.options)}"
        case viser.GuiSliderHandle() | viser.GuiNumberHandle():
            low = -math.inf if handle.min is None else handle.min
            high = math.inf if handle.max is None else handle.max
            # A slider's steps may end a little beyond its range.
            slack = 1e-9 * max(abs(low), abs(high)) if math.isfinite(high - low) else 0.0
            if _are_finite([value], 1) and low - slack <= value <= high + slack:
                return ""
            return f"{_shown(value)} is given; allowed: a number from {low:g} to {high:g}"
    return "it cannot be changed by viewers"


def _wrong_pose(message: Any) -> str:
    if not _are_finite(message.position, 3) or max(map(abs, message.position)) > _FARTHEST:
        return f"a control is dragged to {_shown(message.position)}; allowed: three numbers up to {_FARTHEST:g}"
    if not _are_finite(message.wxyz, 4) or not 0.5 < math.hypot(*message.wxyz) < 2.0:
        return f"a control is turned to {_shown(message.wxyz)}; allowed: a quaternion of unit length"
    return ""


def _allow(message: Any) -> str:
    return ""


def _are_finite(values: Iterable[Any], count: int) -> bool:
    """Return whether values are ``count`` finite numbers."""
    numbers = list(values) if isinstance(values, list | tuple) else []
    real = all(isinstance(each, int | float) and not isinstance(each, bool) for each in numbers)
    return len(numbers) == count and real and all(abs(each) < 1e300 for each in numbers)


def _shown(value: object) -> str:
    return repr(value)[:80]

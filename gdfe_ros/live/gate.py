# SPDX-License-Identifier: Apache-2.0
"""Checks for the page: a token decides who may connect, and only some messages of viewers are accepted.

A browser lets each website that its user opens send requests to this machine. Without these checks, any such website
could command the simulation.
"""

from __future__ import annotations

import hmac
import ipaddress
import math
import secrets
import socket
from collections.abc import Awaitable, Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

import viser
import websockets.asyncio.server
from viser import _messages as messages
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from gdfe_ros.errors import GdfeError
from gdfe_ros.untrusted.real_number import is_number

_KEY = "token"
_LOOPBACK = frozenset({"localhost", "127.0.0.1", "::1"})
_REMEDY = "Open the address that gdfe live has printed, with its token.\n"


class Gate:
    """Admits requests by their headers Host and Origin, and by a token in the address or in a cookie.

    - ``Host`` must be an address of this server: ``localhost``, the name of this machine, or an IP address. The name of
      a stranger that resolves to this machine (DNS rebinding) is refused.
    - ``Origin``, which browsers send with each request from a page, must be this server itself.
    - The address must contain the token. The first answer puts it into a cookie, which the browser sends from then on,
      and only with requests from this server's own page.

    Args:
        token: the token; None: a random one.

    Attributes:
        token: the token.
        refused: number of refused requests.
    """

    def __init__(self, token: str | None = None) -> None:
        self.token = token or secrets.token_urlsafe(24)
        self.refused = 0
        self._hosts = _LOOPBACK | {socket.gethostname().lower(), socket.getfqdn().lower()}

    def refusal(self, request: Request, port: int) -> Response | None:
        """Return the answer of the server at a port to a request that is not admitted; None for an admitted request."""
        reason = self._reason(request, port)
        if not reason:
            return None
        self.refused += 1
        body = f"{reason} {_REMEDY}".encode()
        headers = Headers({"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(body))})
        return Response(HTTPStatus.FORBIDDEN, "Forbidden", headers, body)

    def mark(self, response: Response, port: int) -> None:
        """Put the token into a cookie of an admitted response.

        No script can read the cookie. No page can embed the response, or receive its address as a referrer.
        """
        response.headers["Set-Cookie"] = f"{_cookie(port)}={self.token}; Path=/; HttpOnly; SameSite=Strict"
        response.headers["Referrer-Policy"] = "no-referrer"
        response.headers["X-Frame-Options"] = "DENY"

    def _reason(self, request: Request, port: int) -> str:
        """Return why a request is refused; empty if it is admitted."""
        hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
        if len(hosts) != 1 or not self._is_own(hosts[0]):
            return "The name of this host is not one of this server's."
        if len(origins) > 1 or (origins and origins[0] not in (f"http://{hosts[0]}", f"https://{hosts[0]}")):
            return "The request comes from another page than this server's."
        given = [each.encode(errors="replace") for each in _tokens(request, port)]
        if not any(hmac.compare_digest(each, self.token.encode()) for each in given):
            return "The token of this page is missing or wrong."
        return ""

    def _is_own(self, host: str) -> bool:
        """Return whether a Host header names this server: by an IP address, or by one of this machine's names.

        The port may differ, because another port may be forwarded to this server.
        """
        try:
            name = (urlsplit(f"//{host}").hostname or "").lower()
        except ValueError:
            return False
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return name in self._hosts
        return True


def _tokens(request: Request, port: int) -> list[str]:
    """Return the tokens in the address and in the cookie of a request."""
    found = parse_qs(request.path.partition("?")[2]).get(_KEY, [])
    for header in request.headers.get_all("Cookie"):
        try:
            cookies: Mapping[str, Any] = SimpleCookie(header)
        except CookieError:
            continue
        if _cookie(port) in cookies:
            found.append(cookies[_cookie(port)].value)
    return found


def _cookie(port: int) -> str:
    """Return the name of the cookie; browsers send cookies to all ports of a host."""
    return f"gdfe_live_{port}"


@contextmanager
def guarding(gate: Gate) -> Iterator[None]:
    """Let ``gate`` check each request to a server that ``websockets`` starts inside of the ``with`` block.

    viser has no argument for such a check.

    Raises:
        GdfeError: no server was started by websockets, or it answers no requests; the page would not be guarded.
    """
    plain, guarded = websockets.asyncio.server.serve, []

    def serve(
        handler: Callable[..., Any], host: str, port: int, *more: Any, process_request: Any = None, **options: Any
    ) -> Any:
        def check(connection: Any, request: Request) -> Response | None:
            refusal = gate.refusal(request, port)
            if refusal is not None:
                return refusal
            response = process_request(connection, request)
            if response is not None:
                gate.mark(response, port)
            return response

        if process_request is not None:
            guarded.append(port)
        return plain(handler, host, port, *more, process_request=check, **options)

    websockets.asyncio.server.serve = serve
    try:
        yield
    finally:
        websockets.asyncio.server.serve = plain
    if not guarded:
        raise GdfeError("the page cannot be guarded with this version of viser; remedy: pip install 'gdfe_ros[live]'")


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
                handlers[kind] = [self._guard(handler, checks[kind]) for handler in handlers[kind]]
            else:
                del handlers[kind]

    def welcome(self, client: viser.ClientHandle) -> None:
        """Accept from a new viewer's own connection only the position of its camera."""
        handlers = client._websock_connection._incoming_handlers
        for kind in set(handlers) - {messages.ViewerCameraMessage}:
            del handlers[kind]

    def _guard(self, handler: Handler, wrong: Callable[[Any], str]) -> Handler:
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
        """Return why a message may not update its control; empty if it may. Only a control's value may change."""
        handle = self._gui._gui_input_handle_from_uuid.get(message.uuid)
        if handle is None:
            return ""  # removed meanwhile; viser ignores the message
        if not isinstance(message.updates, dict) or set(message.updates) != {"value"}:
            return f"a viewer may change only the value of a control, not {_show(message.updates)}"
        label, value = getattr(handle, "label", "a control"), message.updates["value"]
        return f"{label}: {reason}" if (reason := _wrong_value(handle, value)) else ""


def _wrong_value(handle: Any, value: Any) -> str:
    """Return why a control cannot have a value; empty if it can."""
    match handle:
        case viser.GuiButtonHandle() | viser.GuiCheckboxHandle():
            return "" if isinstance(value, bool) else f"{_show(value)} is given; allowed: true, false"
        case viser.GuiDropdownHandle():
            good = isinstance(value, str) and value in handle.options
            return "" if good else f"{_show(value)} is given; allowed: {', '.join(handle.options)}"
        case viser.GuiSliderHandle() | viser.GuiNumberHandle():
            low = -math.inf if handle.min is None else handle.min
            high = math.inf if handle.max is None else handle.max
            # A slider's steps may end a little beyond its range.
            slack = 1e-9 * max(abs(low), abs(high)) if math.isfinite(high - low) else 0.0
            if _are_finite([value], 1) and low - slack <= value <= high + slack:
                return ""
            return f"{_show(value)} is given; allowed: a number from {low:g} to {high:g}"
    return "it cannot be changed by viewers"


def _wrong_pose(message: Any) -> str:
    if not _are_finite(message.position, 3) or max(map(abs, message.position)) > _FARTHEST:
        return f"a control is dragged to {_show(message.position)}; allowed: three numbers up to {_FARTHEST:g}"
    if not _are_finite(message.wxyz, 4) or not 0.5 < math.hypot(*message.wxyz) < 2.0:
        return f"a control is turned to {_show(message.wxyz)}; allowed: a quaternion of unit length"
    return ""


def _allow(message: Any) -> str:
    return ""


def _are_finite(values: Iterable[Any], count: int) -> bool:
    """Return whether values are ``count`` finite numbers."""
    numbers = list(values) if isinstance(values, list | tuple) else []
    real = all(map(is_number, numbers))
    return len(numbers) == count and real and all(abs(each) < 1e300 for each in numbers)


def _show(value: object) -> str:
    return repr(value)[:80]

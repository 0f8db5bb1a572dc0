# SPDX-License-Identifier: Apache-2.0
"""Who may connect to the page: a token in its address, and only from a page of this very server.

A browser lets each website that its user opens send requests to this machine. Without these checks, any such website
could command the simulation.
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

import websockets.asyncio.server
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from gdfe_ros.errors import GdfeError

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
        """Put the token into a cookie of an admitted response; pages of other servers can neither read nor embed it."""
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

        Its port may be another one, which is forwarded to this server.
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
    """Let ``gate`` check each request to a server of websockets that is started inside of the ``with`` block.

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

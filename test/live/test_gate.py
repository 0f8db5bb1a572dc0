# SPDX-License-Identifier: Apache-2.0
"""Who may connect to the page, and what viewers may send."""

from __future__ import annotations

import contextlib
import itertools
import random
import socket
import time
from collections.abc import Callable, Iterator
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import msgspec
import pytest
import viser
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from gdfe_ros.errors import GdfeError
from gdfe_ros.live import gate
from gdfe_ros.live.stage import Stage
from test.live.viewer import Viewer

_BURSTS, _BURST = 500, 20
"""Number of bursts of random messages, and of the messages in each."""


def _handshake(page: Any, path: str, **headers: str) -> int:
    """Return the status of the answer to a web socket's handshake."""
    protocol = Subprotocol(f"viser-v{viser.__version__}")
    sock = socket.create_connection(("127.0.0.1", page.port))
    address = f"ws://{headers.pop('host', f'127.0.0.1:{page.port}')}{path}"
    try:
        with connect(address, sock=sock, subprotocols=[protocol], additional_headers=headers, proxy=None) as opened:
            return opened.response.status_code
    except InvalidStatus as error:
        return error.response.status_code


def _get(page: Any, path: str, **headers: str) -> tuple[int, str]:
    """Return the status and the cookie of the answer to a GET."""
    try:
        with urlopen(Request(f"http://127.0.0.1:{page.port}{path}", headers=headers)) as answer:
            return answer.status, answer.headers.get("Set-Cookie", "")
    except HTTPError as error:
        return error.code, ""


def test_strangers_are_refused(live: Callable[..., Any]) -> None:
    """Without the token, from a foreign page, or under a foreign name of this machine, no request is answered."""
    page = live().page
    query, own = f"/?token={page.gate.token}", f"127.0.0.1:{page.port}"
    assert _handshake(page, query) == 101
    assert _handshake(page, query, Origin=f"http://{own}") == 101
    for path in ("/", "/?token=", "/?token=wrong", "/?token=%00", "/?token=%ff", "/?other=1"):
        assert _handshake(page, path) == 403, path
        assert _get(page, path)[0] == 403, path
    for origin in ("http://evil.example", f"http://localhost:{page.port}", "http://127.0.0.1:1", "null", ""):
        assert _handshake(page, query, Origin=origin) == 403, origin
        assert _get(page, query, Origin=origin)[0] == 403, origin
    for host in (f"evil.example:{page.port}", "evil.example", f"127.0.0.1.evil.example:{page.port}"):
        assert _handshake(page, query, host=host, Origin=f"http://{host}") == 403, host
        assert _get(page, query, Host=host)[0] == 403, host
    assert page.gate.refused > 15


def test_the_token_goes_into_a_cookie(live: Callable[..., Any]) -> None:
    """The first answer sets a cookie that only this server's own pages send; it replaces the token in addresses."""
    page = live().page
    status, cookie = _get(page, f"/?token={page.gate.token}")
    assert status == 200
    assert {"HttpOnly", "SameSite=Strict", "Path=/"} <= set(cookie.split("; "))
    name_and_token = cookie.partition(";")[0]
    assert _get(page, "/", Cookie=name_and_token)[0] == 200
    assert _handshake(page, "/", Cookie=f"other=1; {name_and_token}") == 101
    assert _handshake(page, "/", Cookie=name_and_token, Origin="http://evil.example") == 403
    assert _handshake(page, "/", Cookie=name_and_token[:-1]) == 403


def test_a_page_that_cannot_be_guarded_does_not_open() -> None:
    """If viser starts no server through websockets, the page is not opened without a guard."""
    with pytest.raises(GdfeError, match="cannot be guarded"), gate.guarding(gate.Gate()):
        pass


@pytest.mark.parametrize(
    ("label", "updates", "text"),
    [
        ("colour", {"value": "no such field"}, "allowed: equivalent strain"),
        ("colour", {"value": 3}, "allowed: equivalent strain"),
        ("colour", {"removed": True}, "only the value"),
        ("lower, tension [N]", {"value": 1e9}, "allowed: a number from 0 to 2"),
        ("lower, tension [N]", {"value": None}, "allowed: a number"),
        ("lower, tension [N]", {"value": 1.0, "max": 1e9}, "only the value"),
        ("pause", {"removed": True}, "only the value"),
        ("pause", {"update_cb": []}, "only the value"),
        ("hold the range", {"value": "yes"}, "allowed: true, false"),
    ],
)
def test_a_value_that_a_control_cannot_have_is_refused(
    live: Callable[..., Any], label: str, updates: dict[str, Any], text: str
) -> None:
    """A value that is no option or out of range, or another attribute of a control, gives a note; all goes on."""
    page = live()
    viewer = page.look()
    viewer.send("GuiUpdateMessage", uuid=viewer.controls[label]["uuid"], updates=updates)
    viewer.wait(lambda: viewer.notes, "a note")
    assert text in viewer.notes[0]
    viewer.move("lower, tension [N]", 1.5)
    viewer.wait(lambda: page.session.simulation.commands["lower"] == 1.5, "the next command")
    assert page.page.faults == 0


def test_a_fault_in_drawing_ends_nothing(live: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """After frames that cannot be drawn, viewers get a note, the simulation goes on, and so does the drawing."""
    page = live()
    viewer = page.look()
    with monkeypatch.context() as patched:
        patched.setattr(Stage, "mark", lambda stage, view: 1 / 0)
        viewer.move("lower, tension [N]", 1.0)
        viewer.wait(lambda: viewer.notes and page.page.faults, "a note")
    assert "cannot be drawn" in viewer.notes[0]
    frames = viewer.frames
    viewer.move("lower, tension [N]", 1.5)
    viewer.wait(lambda: viewer.frames > frames and page.session.simulation.commands["lower"] == 1.5, "a frame")


def _random_messages(uuids: list[str], dice: random.Random) -> Iterator[dict[str, Any]]:
    """Yield messages of viser's kinds, with random contents."""
    values = (None, True, -1, 1e308, float("nan"), "", "x" * 1000, [], [1, 2, 3], {"a": 1}, b"\0")
    keys = ("value", "removed", "max", "_impl", "label", "update_cb", "sync_cb")
    names = ("/handles/tip", "/probes/goals/middle", "/body/0", "", "/nothing")
    while True:
        updates = {dice.choice(keys): dice.choice(values) for _ in range(dice.randrange(3))}
        yield {"type": "GuiUpdateMessage", "uuid": dice.choice([*uuids, "nobody"]), "updates": updates}
        pose = {"position": dice.choice(values), "wxyz": dice.choice(values), "owner": ""}
        yield {"type": "TransformControlsUpdateMessage", "name": dice.choice(names), **pose}
        yield {"type": "TransformControlsDragStartMessage", "name": dice.choice(names), "owner": ""}
        yield {"type": "TransformControlsDragEndMessage", "name": dice.choice(names), "owner": ""}
        yield {"type": "ShareUrlRequest"}
        yield {"type": "GuiButtonHoldMessage", "uuid": dice.choice(uuids), "frequency": dice.choice(values)}
        yield {
            "type": "FileTransferPart",
            "source_component_uuid": "a",
            "transfer_uuid": "b",
            "part": 1,
            "content": b"",
        }


def test_random_messages_change_nothing_bad(live: Callable[..., Any]) -> None:
    """After ten thousand random messages of a viewer, the page draws, the simulation obeys, no answer takes long."""
    page = live()
    viewer = page.look()

    @settings(
        max_examples=_BURSTS,
        deadline=None,
        database=None,
        derandomize=True,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(st.randoms(use_true_random=False))
    def attack(dice: random.Random) -> None:
        messages = list(itertools.islice(_random_messages(uuids, dice), _BURST))
        if not hostile or hostile[0].socket.close_code is not None:  # viser ends a connection after some messages
            hostile[:] = [opened.enter_context(Viewer(page.page.address()))]
            hostile[0].wait(lambda: hostile[0].controls, "the page")
        with contextlib.suppress(ConnectionClosed):
            for message in messages:
                hostile[0].socket.send(msgspec.msgpack.encode(message))

    hostile: list[Viewer] = []
    uuids = [control["uuid"] for control in viewer.controls.values()]
    with contextlib.ExitStack() as opened:
        attack()
    began = time.monotonic()
    viewer.move("lower, tension [N]", 0.5)
    viewer.wait(lambda: page.session.simulation.commands["lower"] == 0.5, "the next command", patience=60.0)
    assert page.page.faults == 0, viewer.notes
    assert page.session.stepper.failure == ""
    print(f"next command carried out after {time.monotonic() - began:.2f} s")

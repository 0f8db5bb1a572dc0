# SPDX-License-Identifier: Apache-2.0
"""The messages that reach a browser over its web socket, as the browser reports them."""

from __future__ import annotations

import base64
import json
import threading
from collections.abc import Iterator
from typing import Any
from urllib.request import urlopen

from selenium.webdriver.remote.webdriver import WebDriver
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from test.live.viewer import messages_in, vertices_in


class Wire:
    """A client of a browser's DevTools protocol: viser's socket is in a worker of the page.

    Args:
        chrome: driver of the browser, before it opens the page.
    """

    def __init__(self, chrome: WebDriver) -> None:
        address = chrome.capabilities["goog:chromeOptions"]["debuggerAddress"]
        with urlopen(f"http://{address}/json") as answer:
            pages = [target for target in json.load(answer) if target["type"] == "page"]
        self._socket = connect(pages[0]["webSocketDebuggerUrl"], max_size=None)
        self._count = 0
        self._windows: list[str] = []
        self._send("Target.setAutoAttach", autoAttach=True, waitForDebuggerOnStart=True, flatten=True)
        self._send("Network.enable")
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def totals(self) -> Iterator[float]:
        """Yield the sum of the vertex positions of each frame of the body since the last call."""
        windows, self._windows = self._windows, []
        for payload in windows:
            for message in messages_in(base64.b64decode(payload)):
                glb = (message.get("updates") or message.get("props") or {}).get("glb_data")
                if glb is not None:
                    yield float(vertices_in(glb).sum(dtype=float))

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()
        self._thread.join()

    def _send(self, method: str, session: str | None = None, **parameters: Any) -> None:
        self._count += 1
        message = {"id": self._count, "method": method, "params": parameters}
        self._socket.send(json.dumps(message | ({"sessionId": session} if session else {})))

    def _listen(self) -> None:
        try:
            for text in self._socket:
                self._take(json.loads(text))
        except ConnectionClosed:
            return  # the browser has ended

    def _take(self, message: dict[str, Any]) -> None:
        given = message.get("params", {})
        match message.get("method"):
            case "Target.attachedToTarget":
                self._send("Network.enable", given["sessionId"])
                self._send("Runtime.runIfWaitingForDebugger", given["sessionId"])
            case "Network.webSocketFrameReceived":
                self._windows.append(given["response"]["payloadData"])

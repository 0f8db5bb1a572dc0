# SPDX-License-Identifier: Apache-2.0
"""A viewer without a browser, which uses viser's protocol: ten such viewers need less time than one Chromium."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any

import msgspec
import numpy as np
import viser
import zstandard
from numpy.typing import NDArray
from websockets.sync.client import connect
from websockets.typing import Subprotocol

_HEAD = 20
"""Number of bytes of a glTF before its JSON text."""


class Viewer:
    """A connection to a live page; a context manager.

    Args:
        address: address of the page with its token, as `gdfe live` prints it.

    Attributes:
        controls: dict from label of a control to the message that created it.
        content: dict from uuid to text of the page, e.g. the state.
        nodes: dict from name to the properties of a scene node.
        frames: number of frames of the body received so far.
    """

    def __init__(self, address: str) -> None:
        protocol = Subprotocol(f"viser-v{viser.__version__}")
        address = address.replace("http://", "ws://", 1)
        patience = {"open_timeout": 60.0, "close_timeout": 0.1}
        self.socket = connect(address, subprotocols=[protocol], max_size=None, compression=None, **patience)
        self.controls: dict[str, dict[str, Any]] = {}
        self.content: dict[str, str] = {}
        self.values: dict[str, Any] = {}
        self.nodes: dict[str, dict[str, Any]] = {}
        self.notes: list[str] = []
        self.frames = 0
        eye = {"fov": 1.0, "near": 0.01, "far": 100.0, "image_height": 600, "image_width": 800}
        looks = {"wxyz": (1.0, 0.0, 0.0, 0.0), "look_at": (0.0, 0.0, 0.0), "up_direction": (0.0, 0.0, 1.0)}
        self.send("ViewerCameraMessage", position=(1.0, 1.0, 1.0), **eye, **looks)

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.socket.close()

    def wait(self, done: Callable[[], Any], what: str, *, patience: float = 120.0) -> Any:
        """Receive messages until ``done`` returns a true value, and return this value.

        Raises:
            TimeoutError: there is no true value within ``patience`` [s].
        """
        end = time.monotonic() + patience
        while not (found := done()):
            if time.monotonic() > end:
                raise TimeoutError(f"waited {patience:g} s for {what} in vain")
            self.receive(0.1)
        return found

    def receive(self, patience: float) -> bool:
        """Process one window of messages if it arrives within ``patience`` [s]."""
        try:
            data = self.socket.recv(timeout=patience)
        except TimeoutError:
            return False
        for message in messages_in(data):
            self._take(message)
        return True

    def move(self, label: str, value: Any) -> None:
        """Set the value of a control: slider, number, list or check box."""
        self.send("GuiUpdateMessage", uuid=self.controls[label]["uuid"], updates={"value": value})

    def press(self, label: str) -> None:
        """Press a button."""
        self.move(label, True)

    def drag(self, handle: str, position: Any, wxyz: Any = (1.0, 0.0, 0.0, 0.0)) -> None:
        """Drag the control of a handle to a position (3,), in the units of the picture, and an orientation."""
        place, turn = [float(value) for value in position], [float(value) for value in wxyz]
        self.send("TransformControlsUpdateMessage", name=f"/handles/{handle}", position=place, wxyz=turn, owner="")

    def drag_probe(self, probe: str, position: Any) -> None:
        """Drag the control of a probe to a position (3,), in the units of the picture."""
        place = [float(value) for value in position]
        name, turn = f"/probes/goals/{probe}", [1.0, 0.0, 0.0, 0.0]
        self.send("TransformControlsUpdateMessage", name=name, position=place, wxyz=turn, owner="")

    def place(self, handle: str) -> tuple[float, float, float]:
        """Return the position of a handle's control (3,), in the units of the picture."""
        return tuple(self.nodes[f"/handles/{handle}"]["position"])

    def surface(self) -> NDArray[np.float32]:
        """Return the vertices (k, 3) of the last received frame, in the units of the picture."""
        return vertices_in(self.nodes["/body/0" if self.last == 0 else "/body/1"]["glb_data"])

    def text(self) -> str:
        """Return the texts of the page, including the state."""
        return " ".join(self.content.values())

    def send(self, kind: str, **fields: Any) -> None:
        """Send a message of a kind, as the page in a browser does."""
        self.socket.send(msgspec.msgpack.encode({"type": kind, **fields}))

    def _take(self, message: dict[str, Any]) -> None:
        kind = message["type"]
        if kind.startswith("Gui") and "props" in message:
            props, uuid = message["props"], message["uuid"]
            if "content" in props:
                self.content[uuid] = props["content"]
            if label := props.get("label"):
                self.controls[label] = message
                self.values[uuid] = message.get("value")
        elif kind == "GuiUpdateMessage":
            updates, uuid = message["updates"], message["uuid"]
            if "content" in updates:
                self.content[uuid] = updates["content"]
            if "value" in updates:
                self.values[uuid] = updates["value"]
            for label in [label for label, made in self.controls.items() if made["uuid"] == uuid]:
                self.controls[label]["props"] |= updates
                self.controls[updates.get("label", label)] = self.controls.pop(label)
        elif kind == "NotificationShowMessage":
            self.notes.append(message["props"]["body"])
        elif "name" in message:
            node = self.nodes.setdefault(message["name"], {})
            node |= message.get("props", {}) | message.get("updates", {})
            node |= {key: message[key] for key in ("position", "wxyz", "visible") if key in message}
            if "glb_data" in message.get("updates", {}):
                self.frames += 1
                self.last = int(message["name"][-1])
            elif kind == "GlbMessage":
                self.last = getattr(self, "last", 0)


def messages_in(data: bytes) -> list[dict[str, Any]]:
    """Return the messages in a window, as the page sends it."""
    size, packed = struct.unpack("<QQ", data[:16])
    unpacked = zstandard.ZstdDecompressor().decompress(data[16 : 16 + packed], max_output_size=size)
    window = msgspec.msgpack.decode(unpacked)
    buffers, place = [], 16 + packed
    for length in window["binaryBufferLengths"]:
        place += -place % 8
        buffers.append(data[place : place + length])
        place += length
    for message in window["messages"]:
        for part in (message.get("props", {}), message.get("updates", {})):
            part |= {key: _array(value, buffers) for key, value in part.items()}
    return window["messages"]


def vertices_in(glb: bytes) -> NDArray[np.float32]:
    """Return the vertices (k, 3) of the body in a frame, in the units of the picture."""
    length = struct.unpack("<I", glb[12:16])[0]
    count = msgspec.json.decode(glb[_HEAD : _HEAD + length])["accessors"][0]["count"]
    return np.frombuffer(glb, "<f4", count=3 * count, offset=_HEAD + length + 8).reshape(-1, 3)


def _array(value: Any, buffers: list[bytes]) -> Any:
    """Return the buffer that ``value`` refers to as an array; any other value is returned unchanged."""
    if isinstance(value, dict) and "__binary_index" in value:
        return np.frombuffer(buffers[value["__binary_index"]], value["dtype"])
    return value

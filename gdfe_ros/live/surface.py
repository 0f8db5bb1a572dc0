# SPDX-License-Identifier: Apache-2.0
"""The drawn surface, its colours with their legend, and the real robot of a twin beside it.

viser's plain mesh has a single colour; a glTF file has a colour for each vertex.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import viser
from numpy.typing import ArrayLike, NDArray

from gdfe_ros.colour_map import NOISE, VIRIDIS, colour, colour_range
from gdfe_ros.live.interface import View
from gdfe_ros.mesh import HexMesh
from gdfe_ros.scene.scene import Scene

_FLOAT32, _UINT32 = 5126, 5125
_ARRAY, _INDICES = 34962, 34963
_LEAST, _LARGEST = "@least@", "@largest@"
"""Placeholders of the bounds in the template. Every frame overwrites the bounds with texts of the same width."""
_BOUND = "[% .9e,% .9e,% .9e]"
_OPAQUE, _TRANSLUCENT = b'"OPAQUE"', b'"BLEND" '
"""Modes of the material, texts of the same width."""
_OPACITY = 0.35
"""Opacity of a translucent body."""
_GREY = (0.665, 0.665, 0.665)


def _linear(colours: NDArray[np.float64]) -> NDArray[np.float32]:
    """Convert sRGB colours to linear light, as glTF requires."""
    dark = colours <= 0.04045
    return np.where(dark, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4).astype(np.float32)


_LINEAR = _linear(colour(np.linspace(0.0, 1.0, 256)))


class AlternatingBody:
    """Two glTF objects of a page: one is shown while the other one is filled, so that no half-read frame is seen.

    Args:
        space: the scene of the page.
        path: path of the objects in it.
        first: the frame that is shown first.
    """

    def __init__(self, space: viser.SceneApi, path: str, first: bytes) -> None:
        self._bodies = [space.add_glb(f"{path}/{place}", first, visible=not place) for place in range(2)]
        self._shown = 0

    def fill(self, frame: bytes) -> None:
        """Send a frame, which stays hidden until `turn` shows it."""
        self._bodies[1 - self._shown].glb_data = frame

    def turn(self) -> None:
        """Show the frame that was sent last, and hide the other one."""
        self._bodies[1 - self._shown].visible = True
        self._bodies[self._shown].visible = False
        self._shown = 1 - self._shown


class DrawnSurface:
    """The boundary of a mesh, or the finer skin embedded in it, as triangles with a colour at each point.

    Args:
        mesh: the undeformed body.
        scale: factor from metres to the units of the view.
        plain: colour of all points of a frame without values: red, green and blue, 0 to 1.

    Attributes:
        outside: the drawn surface, with its points.
        count: number of points.
        triangles: (t, 3) uint32 indices of points.
    """

    def __init__(self, mesh: HexMesh, *, scale: float = 1.0, plain: ArrayLike = _GREY) -> None:
        self.outside = outside = mesh.outside
        self.count = len(outside.corners)
        self.triangles = np.ascontiguousarray(outside.triangles, dtype=np.uint32)
        self._scale, self._plain = scale, _linear(np.asarray(plain, dtype=np.float64))
        self._data = bytearray(self._template())
        count = 3 * self.count
        numbers = np.frombuffer(self._data, "<f4", count=2 * count, offset=self._start)
        self._positions, self._colours = numbers[:count].reshape(-1, 3), numbers[count:].reshape(-1, 3)

    def be_translucent(self, wanted: bool) -> None:
        """Make the body translucent or opaque in the next frames."""
        self._data[self._mode : self._mode + len(_OPAQUE)] = _TRANSLUCENT if wanted else _OPAQUE

    def pack(self, positions: NDArray[np.float64], shares: NDArray[np.float64] | None) -> bytes:
        """Return a frame as glTF.

        Args:
            positions: positions of all vertices of the mesh (n, 3) [m].
            shares: position of each point's value in the colour map (k,), 0 to 1; None: all points are plain.
        """
        np.multiply(self.outside.at(positions), self._scale, out=self._positions, casting="same_kind")
        if shares is None:
            self._colours[:] = self._plain
        else:
            self._colours[:] = _LINEAR[(shares * (len(_LINEAR) - 1) + 0.5).astype(np.intp)]
        for place, bound in zip(self._bounds, (self._positions.min(axis=0), self._positions.max(axis=0)), strict=True):
            text = (_BOUND % tuple(bound)).encode()
            self._data[place : place + len(text)] = text
        return bytes(self._data)

    def _template(self) -> bytes:
        """Return a glTF file with zeros in place of a frame's data, and store the offsets of the data."""
        count, faces = self.count, self.triangles.tobytes()
        size = 12 * count
        views = [(0, size, _ARRAY), (size, size, _ARRAY), (2 * size, len(faces), _INDICES)]
        vectors = {"componentType": _FLOAT32, "count": count, "type": "VEC3"}
        document = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [
                {"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2, "material": 0, "mode": 4}]}
            ],
            "materials": [
                {
                    "doubleSided": True,
                    "alphaMode": "OPAQUE",
                    "pbrMetallicRoughness": {
                        "metallicFactor": 0.0,
                        "roughnessFactor": 0.9,
                        "baseColorFactor": [1.0, 1.0, 1.0, _OPACITY],
                    },
                }
            ],
            "buffers": [{"byteLength": 2 * size + len(faces)}],
            "bufferViews": [
                {"buffer": 0, "byteOffset": start, "byteLength": length, "target": target}
                for start, length, target in views
            ],
            "accessors": [
                {**vectors, "bufferView": 0, "min": _LEAST, "max": _LARGEST},
                {**vectors, "bufferView": 1},
                {"bufferView": 2, "componentType": _UINT32, "count": self.triangles.size, "type": "SCALAR"},
            ],
        }
        text = json.dumps(document, separators=(",", ":"))
        for mark in (_LEAST, _LARGEST):
            text = text.replace(f'"{mark}"', _BOUND % (0.0, 0.0, 0.0))
        head = text.encode() + b" " * (-len(text) % 4)
        first = 20 + head.index(b'"min":') + len(b'"min":')
        second = 20 + head.index(b'"max":') + len(b'"max":')
        self._bounds, self._start, self._mode = (first, second), 20 + len(head) + 8, 20 + head.index(_OPAQUE)
        body = bytes(2 * size) + faces
        chunks = struct.pack("<II", len(head), 0x4E4F534A) + head + struct.pack("<II", len(body), 0x004E4942) + body
        return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


_GREEN = (30, 160, 60)
_ROOT = "/robot"
"""Path of all objects of the robot in the view."""
_POINT = 0.03
"""Diameter of a measured point, divided by the body's size."""


class RealRobot:
    """Draws a robot in green, its body translucent.

    Args:
        space: the scene of the page.
        mesh: the undeformed body.
        scale: factor from metres to the units of the view.
        size: size of the body in the units of the view.
    """

    def __init__(self, space: viser.SceneApi, mesh: HexMesh, *, scale: float, size: float) -> None:
        self._space, self._scale, self._size = space, scale, size
        self._surface = DrawnSurface(mesh, scale=scale, plain=np.array(_GREEN) / 255.0)
        self._surface.be_translucent(True)
        self._body: AlternatingBody | None = None

    def draw(
        self, places: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]], body: NDArray[np.float64] | None
    ) -> None:
        """Draw the robot.

        Args:
            places: dict from probe to its measured and simulated position, each (3,) [m].
            body: positions of the vertices of the measured body (n, 3) [m]; None: it is not drawn.
        """
        measured, simulated = (self._scale * np.array(each) for each in zip(*places.values(), strict=True))
        self._space.add_point_cloud(
            f"{_ROOT}/points",
            measured.astype(np.float32),
            _GREEN,
            point_size=_POINT * self._size,
            point_shape="rounded",
        )
        lines = np.stack([measured, simulated], axis=1).astype(np.float32)
        self._space.add_line_segments(f"{_ROOT}/distances", lines, _GREEN, thickness=2.0, thickness_units="screen")
        for name, place, other in zip(places, measured, simulated, strict=True):
            length = float(np.linalg.norm(place - other)) / self._scale
            self._space.add_label(f"{_ROOT}/{name}", f"{name}: {1e3 * length:.2f} mm", position=place)
        if body is not None:
            self._draw_body(self._surface.pack(body, None))

    def _draw_body(self, frame: bytes) -> None:
        if self._body is None:
            self._body = AlternatingBody(self._space, f"{_ROOT}/body", frame)
            return
        self._body.turn()  # the object that was filled at the last call has been read by now
        self._body.fill(frame)


@dataclass(frozen=True)
class Field:
    """A field that colours the body.

    Attributes:
        label: name for users, with the unit.
        values: function that returns the field at the points of the surface (k,) after a step.
        noise: smallest width of the colour range, in the unit of the field; it hides smaller differences, which are
            noise.
    """

    label: str
    values: Callable[[View, DrawnSurface], NDArray[np.float64]]
    noise: float = NOISE


def fields_of(scene: Scene) -> dict[str, Field]:
    """Return the fields of a scene by label; fields of the cells are averaged at the surface points."""

    def of_cells(label: str, name: str) -> Field:
        return Field(label, lambda view, surface: surface.outside.average(view.fields()[name]))

    def of_vertices(label: str, give: Callable[[View], NDArray[np.floating]]) -> Field:
        noise = NOISE * scene.mesh.size
        return Field(label, lambda view, surface: np.linalg.norm(surface.outside.at(give(view)), axis=1), noise)

    found = [
        of_cells("equivalent strain [1]", "eps_eq"),
        of_vertices("displacement [m]", lambda view: view.positions - scene.mesh.vertices),
        of_cells("elastic volume ratio [1]", "J"),
        of_cells("energy density [J/m^3]", "energy_density"),
        of_cells("tangent modulus [Pa]", "tangent"),
        of_cells("shape factor [1]", "omega"),
    ]
    if scene.dynamics:
        found.append(of_vertices("speed [m/s]", lambda view: view.velocities))
    return {field.label: field for field in found}


class Range:
    """Colour range from the smallest to the largest value of a frame, or a constant range.

    Attributes:
        low, high: bounds; unless ``held``, the smallest and largest value of the last frame.
        held: whether the bounds stay constant.
    """

    def __init__(self) -> None:
        self.low, self.high, self.held = 0.0, 0.0, False

    def shares(self, values: NDArray[np.float64], *, noise: float = NOISE) -> NDArray[np.float64]:
        """Return values (k,) relative to the range, 0 to 1; unless ``held``, the range is first fitted to the values.

        The fitted range has at least the width ``noise``.
        """
        if not self.held:
            self.low, self.high = colour_range(float(values.min()), float(values.max()), noise=noise)
        span = self.high - self.low
        return np.clip((values - self.low) / span, 0.0, 1.0) if span > 0.0 else np.zeros_like(values)


def legend(label: str, bounds: Range) -> str:
    """Return a colour bar with its numbers, as HTML."""
    stops = ",".join("rgb({:.0f},{:.0f},{:.0f})".format(*(255 * stop)) for stop in VIRIDIS)
    numbers = "".join(f"<span>{value:.3g}</span>" for value in np.linspace(bounds.low, bounds.high, 5))
    return (
        f'<div id="legend" style="font-size:0.8em;padding:0 0.8em 0.5em"><div>{label}</div>'
        f'<div style="height:0.8em;border-radius:2px;background:linear-gradient(90deg,{stops})"></div>'
        f'<div style="display:flex;justify-content:space-between">{numbers}</div></div>'
    )

# SPDX-License-Identifier: Apache-2.0
"""Parameters of a fit: numbers in a scene file, with bounds."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from gdfe_ros.errors import GdfeError
from gdfe_ros.scene import scene_from_text
from gdfe_ros.scene.document import parse_document
from gdfe_ros.scene.report import list_keys, suggest
from gdfe_ros.scene.scene import Scene

_FORM = "--vary takes KEY=LOW..HIGH or KEY=LOW..START..HIGH, e.g. materials.silicone.young=1e5..1e6"


@dataclass(frozen=True)
class FittedParameter:
    """A key of the scene, and the interval in which its value is searched.

    The solver's coordinate is u = ln(value) if the lower bound is positive, else u = value / (high - low). Therefore
    equal steps in u are comparable between parameters.

    Attributes:
        key: dotted key, as in an override.
        low: least value.
        high: largest value.
        start: initial value.
    """

    key: str
    low: float
    high: float
    start: float

    @property
    def logarithmic(self) -> bool:
        """Whether u is the logarithm of the value."""
        return self.low > 0.0

    def coordinate(self, value: float) -> float:
        """Return the coordinate u of a value."""
        return math.log(value) if self.logarithmic else value / (self.high - self.low)

    def value(self, coordinate: float) -> float:
        """Return the value at coordinate u. It is clipped to the bounds, which rounding may exceed."""
        value = math.exp(coordinate) if self.logarithmic else coordinate * (self.high - self.low)
        return min(max(value, self.low), self.high)

    def slope(self, value: float) -> float:
        """Return d(value)/du."""
        return value if self.logarithmic else self.high - self.low


def read_parameters(entries: Iterable[str], scene: Scene) -> list[FittedParameter]:
    """Return the parameters in entries ``KEY=LOW..HIGH`` or ``KEY=LOW..START..HIGH``.

    Without ``START``, the initial value is the scene's value if it is between the bounds, else their middle.

    Raises:
        GdfeError: there is no entry, one is malformed, two have the same key, or the scene's value is not a number.
        SceneError: the scene does not have a key, or does not allow an initial value.
    """
    data = parse_document(scene.source, heading=f"scene {scene.name}").data
    found = [_parameter(entry, data) for entry in entries]
    if not found:
        raise GdfeError(f"nothing to fit; {_FORM}")
    keys = [parameter.key for parameter in found]
    if twice := {key for key in keys if keys.count(key) > 1}:
        raise GdfeError(f"--vary names {', '.join(sorted(twice))} twice; give each key once")
    starts = {parameter.key: parameter.start for parameter in found}
    scene_from_text(scene.source, origin=f"with {', '.join(starts)} from --vary", overrides=starts)
    return found


def _parameter(entry: str, data: object) -> FittedParameter:
    key, separator, interval = entry.partition("=")
    try:
        numbers = [float(part) for part in interval.split("..")]
    except ValueError:
        numbers = []
    key = key.strip()
    if not separator or len(numbers) not in (2, 3) or not all(map(math.isfinite, numbers)):
        raise GdfeError(f"{entry!r} is no parameter; {_FORM}")
    low, high = numbers[0], numbers[-1]
    if not low < high or not low <= numbers[1] <= high:
        raise GdfeError(f"--vary {key}: {interval}; allowed: LOW < HIGH, and START between them")
    _require_names(key, data)
    own = _look_up(key, data)
    middle = math.sqrt(low * high) if low > 0.0 else 0.5 * (low + high)
    start = numbers[1] if len(numbers) == 3 else own if own is not None and low <= own <= high else middle
    return FittedParameter(key, low, high, start)


def _require_names(key: str, data: object) -> None:
    """Raise GdfeError if ``key`` contains a name, e.g. of a material, that the scene does not have."""
    parts = key.split(".")
    for depth, part in enumerate(parts[:-1]):
        if not isinstance(data, dict):
            return
        if part not in data and depth and not list_keys(tuple(parts[:depth])):
            place = ".".join(parts[:depth])
            raise GdfeError(f"--vary {key}: the scene has no {part!r} in {place}{suggest(part, list(data))}")
        data = data.get(part)


def _look_up(key: str, data: object) -> float | None:
    """Return the number at a dotted ``key`` of the scene; None if the scene does not have the key."""
    for part in key.split("."):
        if isinstance(data, list) and part.isdecimal() and int(part) < len(data):
            data = data[int(part)]
        elif isinstance(data, dict) and part in data:
            data = data[part]
        else:
            return None
    if isinstance(data, bool) or not isinstance(data, int | float | str):
        raise GdfeError(f"--vary {key}: the scene has {data!r} there; a number is needed: name one of its parts")
    try:
        return float(data)
    except ValueError:
        raise GdfeError(f"--vary {key}: the scene has {data!r} there; a number is needed") from None

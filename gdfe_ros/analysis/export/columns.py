# SPDX-License-Identifier: Apache-2.0
"""Names and SI units of exported columns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from gdfe_ros.actuators import Actuator, Mode
from gdfe_ros.analysis.difference_table import unit_of

JOINTS = "joint_states"
_CABLE = (Mode.TENSION, Mode.LENGTH, Mode.SHORTENING)
_CHAMBER = (Mode.PRESSURE, Mode.VOLUME)
_TIMES = {"time": "s", "dt": "s", "wall_time": "s", "solve_time": "s", "stamp": "ns"}
_COMPONENTS = ("x", "y", "z", "w")
_RATES = {"m": "m/s", "m^3": "m^3/s", "": "1/s"}


class Columns:
    """Names of the entries of joint states, and units of all columns.

    Args:
        actuators: the scene's actuators, in the order of joint states.
    """

    def __init__(self, actuators: Iterable[Actuator]) -> None:
        self._actuators = {actuator.name: actuator for actuator in actuators}
        self._frames: dict[str, str] = {}

    @property
    def joints(self) -> list[str]:
        """Names of the entries of joint states."""
        return list(self._actuators)

    def unit(self, column: str) -> str:
        """Return the SI unit of a table's column or of an array; empty for counts, texts and ratios."""
        topic, _, field = column.replace("/", ".").rpartition(".")
        if column in _TIMES:
            return _TIMES[column]
        if column.startswith("command."):
            actuator = self._actuators.get(column.removeprefix("command."))
            return actuator.mode.unit if actuator else ""
        if column.startswith(("target.", "set.")):
            return "rad" if field.startswith("r") else "m"
        if topic.startswith(f"{JOINTS}."):
            return self._joint_unit(self._actuators[topic.partition(".")[2]].mode, field)
        if ".orientation." in column:
            return ""
        # For wrench.force.z the word before the component determines the unit; z alone would be a length.
        return unit_of(f".{topic.rpartition('.')[2]}.{field}") or unit_of(field)

    def note_frames(self, frames: Mapping[str, str]) -> None:
        """Note the coordinate frames of topics, which the headings of their columns state."""
        self._frames |= frames

    def frame(self, column: str) -> str:
        """Return the name of the coordinate frame of a column's number; empty for numbers that have none."""
        if column.rpartition(".")[2] not in _COMPONENTS:
            return ""
        return next((frame for topic, frame in self._frames.items() if column.startswith(f"{topic}.")), "")

    def headed(self, column: str) -> str:
        """Return the heading of a column: its name, unit and frame, e.g. ``time [s]``, ``x [m in base_link]``."""
        parts = [self.unit(column), *(["in", frame] if (frame := self.frame(column)) else [])]
        text = " ".join(part for part in parts if part)
        return f"{column} [{text}]" if text else column

    def _joint_unit(self, mode: Mode, field: str) -> str:
        extent = "m" if mode in _CABLE else "m^3" if mode in _CHAMBER else ""
        if field == "effort":
            return "N" if mode in _CABLE else "Pa" if mode in _CHAMBER else ""
        return _RATES[extent] if field == "velocity" else extent

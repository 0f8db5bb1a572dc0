# SPDX-License-Identifier: Apache-2.0
"""Names and SI units of exported columns."""

from __future__ import annotations

from collections.abc import Iterable

from gdfe_ros.actuators import Actuator, Mode
from gdfe_ros.analysis.difference_table import unit_of

JOINTS = "joint_states"
_CABLE = (Mode.TENSION, Mode.LENGTH, Mode.SHORTENING)
_CHAMBER = (Mode.PRESSURE, Mode.VOLUME)
_TIMES = ("time", "dt", "wall_time")
_RATES = {"m": "m/s", "m^3": "m^3/s", "": "1/s"}


class Columns:
    """Names of the entries of joint states, and units of all columns.

    Args:
        actuators: the scene's actuators, in the order of joint states.
    """

    def __init__(self, actuators: Iterable[Actuator]) -> None:
        self._actuators = {actuator.name: actuator for actuator in actuators}

    @property
    def joints(self) -> list[str]:
        """Names of the entries of joint states."""
        return list(self._actuators)

    def unit(self, column: str) -> str:
        """Return the SI unit of a table's column or of an array; empty for counts, texts and ratios."""
        topic, _, field = column.replace("/", ".").rpartition(".")
        if column in _TIMES:
            return "s"
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

    def headed(self, column: str) -> str:
        """Return the heading of a column: its name with its unit, e.g. ``time [s]``."""
        unit = self.unit(column)
        return f"{column} [{unit}]" if unit else column

    def _joint_unit(self, mode: Mode, field: str) -> str:
        extent = "m" if mode in _CABLE else "m^3" if mode in _CHAMBER else ""
        if field == "effort":
            return "N" if mode in _CABLE else "Pa" if mode in _CHAMBER else ""
        return _RATES[extent] if field == "velocity" else extent

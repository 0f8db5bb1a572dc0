# SPDX-License-Identifier: Apache-2.0
"""Differences of two runs as a table for users."""

from __future__ import annotations

from collections import defaultdict

from rich.table import Table

from gdfe_ros.analysis.bag_run import CONTACTS, RECORD
from gdfe_ros.analysis.difference import Differences, FieldDifference, Place
from gdfe_ros.untrusted.terminal import PlainConsole

UNITS = {
    "x": "m", "y": "m", "z": "m", "ux": "m", "uy": "m", "uz": "m", "X": "m", "positions": "m",
    "time": "s", "dt": "s", "wall_time": "s", "solve_time": "s", "stamp": "ns",
    "tangent": "Pa", "energy_density": "J/m^3", "energy": "J", "position": "m", "force": "N", "torque": "N m",
    "gap": "m", "fx": "N", "fy": "N", "fz": "N", "tx": "N", "ty": "N", "tz": "N",
    "vx": "m/s", "vy": "m/s", "vz": "m/s", "angular_velocity": "rad/s", "linear_acceleration": "m/s^2", "energies": "J",
}  # fmt: skip
_COLUMNS = ("x y z", "ux uy uz", "vx vy vz", "nx ny nz", "fx fy fz", "tx ty tz")
_VECTORS = {part: vector for vector in _COLUMNS for part in vector.split()}
_NARROW = 130


def wide_console() -> PlainConsole:
    """Return a console that does not limit tables to the 80 columns of a file or pipe."""
    console = PlainConsole(soft_wrap=True)
    return console if console.is_terminal else PlainConsole(soft_wrap=True, width=_NARROW)


def difference_table(differences: Differences, *, factor: float) -> Table:
    """Return a table of the differences, in the order of occurrence.

    A vector has one row, with its worst component.

    Args:
        differences: differences of two runs.
        factor: number of solver tolerances for the column ``allowed``; 0 for a table without this column.
    """
    table = Table(title="differences", title_justify="left")
    for heading in ("topic", "field", "arrays", "first at", "largest", "of", "at"):
        table.add_column(heading, justify="left" if heading in ("topic", "field") else "right", no_wrap=True)
    if factor > 0.0:
        table.add_column("allowed", justify="right")
    groups: dict[tuple[str, str], list[FieldDifference]] = defaultdict(list)
    for entry in differences.differing:
        groups[entry.topic, _vector(entry)].append(entry)
    for (topic, name), entries in groups.items():
        row = [topic, name, f"{max(e.differing for e in entries)} of {entries[0].compared}", *_figures(entries)]
        if factor > 0.0:
            row.append(f"{max(differences.bound_difference(entry, factor) for entry in entries):.2e}")
        table.add_row(*row)
    return table


def unit_of(field: str) -> str:
    """Return the SI unit of a published field; empty if it has none, or not the same for all entries."""
    if field == "position":  # of joint states: angles, lengths, pressures
        return ""
    # For wrench.force.z the word before the component determines the unit; z alone would be a length.
    return UNITS.get(field.split(".")[-2] if "." in field else field, "")


def where(place: Place, topic: str) -> str:
    """Return the time and the vertex or cell of a difference, as text."""
    kind = {"mesh": "vertex", "velocity": "vertex", "strain": "cell", CONTACTS: "point"}.get(topic)
    repeat = f" ({place.key[1] + 1})" if place.key[1] else ""
    return f"{place.stamp:.9g} s{repeat}" + (f", {kind} {place.element}" if kind else "")


def _vector(entry: FieldDifference) -> str:
    if entry.topic == RECORD:
        return entry.field
    return _VECTORS.get(entry.field) or (entry.field.rpartition(".")[0] or entry.field)


def _figures(entries: list[FieldDifference]) -> list[str]:
    numbers = [entry for entry in entries if entry.first is not None and entry.most is not None]
    if not numbers:
        return ["", "other length", "", ""]
    worst = max(numbers, key=lambda entry: entry.largest)
    first = min((entry.first for entry in numbers), key=lambda place: place.key)
    return [
        where(first, worst.topic),
        f"{worst.largest:.3g} {unit_of(worst.field)}".rstrip(),
        f"{max(entry.scale for entry in numbers):.3g}",
        where(worst.most, worst.topic),
    ]

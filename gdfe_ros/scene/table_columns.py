# SPDX-License-Identifier: Apache-2.0
"""Columns of a testing machine's table: which are strain and stress, and in which unit."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

STRAIN_UNITS = {"": 1.0, "1": 1.0, "-": 1.0, "mm/mm": 1.0, "m/m": 1.0, "in/in": 1.0, "%": 0.01, "mm/m": 1e-3}
"""Dict from unit of strain to the strain of one unit."""
STRESS_UNITS = {
    "": 1.0, "pa": 1.0, "n/m2": 1.0, "kpa": 1e3, "mpa": 1e6, "n/mm2": 1e6, "gpa": 1e9, "bar": 1e5, "psi": 6894.757,
    "ksi": 6894757.0, "kgf/cm2": 98066.5, "kg/cm2": 98066.5,
}  # fmt: skip
"""Dict from unit of stress to pascals."""
LENGTH_UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "mm2": 1e-6, "cm2": 1e-4, "m2": 1.0}
FORCE_UNITS = {"n": 1.0, "kn": 1e3, "mn": 1e-3, "lbf": 4.4482216, "kgf": 9.80665, "gf": 9.80665e-3}

_STRAIN = re.compile(r"strain|dehnung|déformation|deformation|stauchung|\bepsilon\b|ε")
_STRESS = re.compile(r"stress|spannung|contrainte|\bsigma\b|\u03c3")
_TRUE = re.compile(r"\btrue|\bcauchy|wahre|\blog|hencky|vraie")
_FORCE = re.compile(r"\bload\b|force|kraft|charge")
_EXTENSION = re.compile(r"extension|displacement|weg\b|elongation|verlängerung|crosshead|allongement")
_SIZES = {
    "width": re.compile(r"width|breite|largeur"),
    "thickness": re.compile(r"thickness|dicke|épaisseur"),
    "area": re.compile(r"area|querschnitt|section"),
    "length": re.compile(r"length|länge|longueur|gauge"),
}
_UNIT = re.compile(
    r"[\[(]\s*([^\])]*?)\s*[\])]\s*$|\bin\s+(\S+)\s*$|[_ ](%|mpa|kpa|pa|n/mm²|n/mm2|mm/mm)$", re.IGNORECASE
)


@dataclass(frozen=True)
class TableColumn:
    """A column of numbers.

    Attributes:
        place: its index.
        factor: value in SI units of the number 1.
    """

    place: int
    factor: float

    def value(self, row: Sequence[str], number: Callable[[str], float | None]) -> float | None:
        """Return the value in SI units in a row; None if there is no number."""
        found = number(row[self.place]) if self.place < len(row) else None
        return None if found is None else self.factor * found


def is_unit_row(row: Sequence[str]) -> bool:
    """Return whether a row has units, or nothing, in each of its cells, and at least one unit."""
    units = {**STRAIN_UNITS, **STRESS_UNITS, **LENGTH_UNITS, **FORCE_UNITS, "s": 1.0, "sec": 1.0, "min": 1.0, "°c": 1.0}
    plain = [_plain_unit(cell) for cell in row]
    return any(plain) and all(cell in units and not cell.replace(".", "").isdigit() for cell in plain)


def find_columns(
    titles: Sequence[str], units: Sequence[str], above: Sequence[Sequence[str]]
) -> tuple[TableColumn, TableColumn, list[str]] | None:
    """Return the columns strain and stress of a header, and remarks on the choice; None if it is no such header.

    Args:
        titles: cells of the header.
        units: cells of the row below it, or empty texts.
        above: rows above the header, which may state the specimen's size.

    Raises:
        ValueError: there are such columns, but with an unknown unit, or only of true stress.
    """
    stresses = _matching(titles, _STRESS)
    strains = [place for place in _matching(titles, _STRAIN) if place not in stresses]
    remarks: list[str] = []
    strain = _chosen(strains, titles, units, STRAIN_UNITS, "strain", remarks)
    stress = _chosen(stresses, titles, units, STRESS_UNITS, "stress", remarks)
    if stress is None and (forces := _matching(titles, _FORCE)) and (area := _sizes(above).get("area")):
        force = _chosen(forces, titles, units, FORCE_UNITS, "force", remarks)
        stress = TableColumn(force.place, force.factor / area)
        remarks.append(f"stress is {titles[force.place]!r} over the area of {area:.4g} m^2")
    extensions = [place for place in _matching(titles, _EXTENSION) if place not in strains]
    if strain is None and extensions and (length := _sizes(above).get("length")):
        extension = _chosen(extensions, titles, units, LENGTH_UNITS, "extension", remarks)
        strain = TableColumn(extension.place, extension.factor / length)
        remarks.append(f"strain is {titles[extension.place]!r} over the length of {length:.4g} m")
    return None if strain is None or stress is None else (strain, stress, remarks)


def _matching(titles: Sequence[str], pattern: re.Pattern[str]) -> list[int]:
    """Return the places of the titles in which a pattern is found."""
    return [place for place, title in enumerate(titles) if pattern.search(title.lower())]


def _chosen(
    places: Sequence[int],
    titles: Sequence[str],
    units: Sequence[str],
    known: dict[str, float],
    noun: str,
    remarks: list[str],
) -> TableColumn | None:
    """Return the first of several columns that are no true stress or strain, with its factor; None without columns."""
    usual = [place for place in places if not _TRUE.search(titles[place].lower())]
    if places and not usual:
        text = f"the column {titles[places[0]]!r} is no engineering {noun}"
        raise ValueError(f"{text}; remedy: engineering strain and nominal stress, force over the initial area")
    if not usual:
        return None
    place = usual[0]
    if len(usual) > 1:
        remarks.append(f"{len(usual)} columns of {noun}: the first, {titles[place]!r}, is used")
    given = units[place] if place < len(units) and units[place] else _unit_in(titles[place], known)
    unit = _plain_unit(given)
    if unit not in known:
        allowed = ", ".join(key for key in known if key)
        raise ValueError(f"the column {titles[place]!r} has the unit {given!r}; allowed: {allowed}; remedy: convert it")
    return TableColumn(place, known[unit])


def _unit_in(title: str, known: dict[str, float]) -> str:
    """Return the unit in a title, such as ``Stress [MPa]``; an empty text if there is none.

    A text in round brackets that is no unit, such as ``Tensile strain (Extension)``, names the source.
    """
    found = _UNIT.search(title)
    unit = next((part for part in found.groups() if part is not None), "") if found else ""
    return unit if "[" in title or _plain_unit(unit) in known or re.search(r"[%/²]|pa$", unit, re.IGNORECASE) else ""


def _plain_unit(cell: str) -> str:
    """Return a unit in small letters, without brackets, powers as digits."""
    return cell.strip().strip("[]()").strip().lower().replace("²", "2").replace("^2", "2").replace(" ", "")


def _sizes(above: Sequence[Sequence[str]]) -> dict[str, float]:
    """Return area [m^2] and length [m] of the specimen, as far as the rows above the header state them."""
    found: dict[str, float] = {}
    for row in above:
        for name, pattern in _SIZES.items():
            if name not in found and row and pattern.search(row[0].lower()):
                value = _size(row)
                found |= {} if value is None else {name: value}
    if "area" not in found and {"width", "thickness"} <= found.keys():
        found["area"] = found["width"] * found["thickness"]
    return found


def _size(row: Sequence[str]) -> float | None:
    """Return the length [m] or area [m^2] in a row such as ``Width, 6.0, mm``; None if there is none."""
    text = " ".join(row[1:]) if len(row) > 1 else row[0].rpartition(":")[2]
    parts = text.replace(",", ".").split()
    unit = _plain_unit(parts[1]) if len(parts) > 1 else _plain_unit(_unit_in(row[0], LENGTH_UNITS))
    try:
        value = float(parts[0]) * LENGTH_UNITS[unit]
    except (IndexError, KeyError, ValueError):
        return None
    return value if math.isfinite(value) and value > 0.0 else None

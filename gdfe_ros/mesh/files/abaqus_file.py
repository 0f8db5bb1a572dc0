# SPDX-License-Identifier: Apache-2.0
"""Meshes of Abaqus input files: parts, their instances with their places, sets of nodes and elements."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.files.abaqus_deck import Block, read_blocks
from gdfe_ros.mesh.files.raw_mesh import CellBlock, RawMesh

_SOLIDS = {4: "tetra", 5: "pyramid", 6: "wedge", 8: "hexahedron", 10: "tetra10", 13: "pyramid13", 15: "wedge15",
           20: "hexahedron20", 27: "hexahedron27"}  # fmt: skip
"""Dict from the number of nodes of a solid element to the kind of its cell."""
_SOLID = re.compile(r"(?:D?C3D|AC3D)(\d+)[A-Z]*")
"""Types of solid elements: C3D8RH, C3D10M, C3D4H, ..."""
_MAKERS = {"NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM", "MODEL CHANGE"}
"""Keywords that generate, copy or move nodes and elements; files with these keywords are refused."""


@dataclass(eq=False)
class _Part:
    """Nodes, elements and sets of a part or of an instance, by Abaqus' numbers.

    A node at X is at x = R (X + shift - centre) + centre.

    Attributes:
        nodes: dict from the number of a node to its position X.
        elements: dict from the number of an element to its type and its nodes.
        sets: dicts from name to numbers, of nodes under NSET and of elements under ELSET.
        shift: translation (3,) of an instance.
        turn: rotation R of an instance.
        centre: point (3,) on the axis of the rotation.
    """

    nodes: dict[int, tuple[float, ...]] = field(default_factory=dict)
    elements: dict[int, tuple[str, list[int]]] = field(default_factory=dict)
    sets: dict[str, dict[str, list[int]]] = field(default_factory=lambda: {"NSET": {}, "ELSET": {}})
    shift: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    turn: Rotation = field(default_factory=Rotation.identity)
    centre: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))

    def copy(self) -> _Part:
        """Return a copy of a part, for an instance that adds its own nodes, elements and sets."""
        sets = {key: {name: list(ids) for name, ids in each.items()} for key, each in self.sets.items()}
        return _Part(dict(self.nodes), dict(self.elements), sets)

    def points(self) -> NDArray[np.float64]:
        """Return the positions (n, 3) of the nodes, in the order of the file."""
        raw = np.array(list(self.nodes.values()), dtype=np.float64).reshape(-1, 3) + self.shift
        return raw if self.turn.magnitude() == 0.0 else self.turn.apply(raw - self.centre) + self.centre


def read_abaqus(path: Path, heading: str) -> RawMesh:
    """Return the mesh of an Abaqus input file, with each instance at its place.

    Sets of the same name in several instances are united. If there are several instances, the elements of each are a
    set with the instance's name.

    Raises:
        MeshError: the file has defects, or a part of it cannot be read; the error names keyword and line.
    """
    reader = _Reader(heading)
    for block in read_blocks(path, heading):
        reader.add(block)
    return reader.mesh()


class _Reader:
    """Reader of the blocks of one file. It adds each block to the part, instance or assembly that is open."""

    def __init__(self, heading: str) -> None:
        self._heading = heading
        self._flat, self._assembly = _Part(), _Part()
        self._parts: dict[str, _Part] = {}
        self._instances: dict[str, _Part] = {}
        self._used: set[str] = set()
        self._current: list[_Part] = [self._flat]
        self._remarks: list[str] = []

    def add(self, block: Block) -> None:
        """Read one block."""
        try:
            self._take(block)
        except (ValueError, IndexError) as error:
            text = f"line {block.line}: the data of *{block.keyword} cannot be read as numbers and names"
            raise self._defect(f"{text}; remedy: export it again") from error

    def _take(self, block: Block) -> None:
        part = self._current[-1]
        match block.keyword:
            case "PART":
                self._current.append(self._parts.setdefault(block.name("NAME").upper(), _Part()))
            case "ASSEMBLY":
                self._current.append(self._assembly)
            case "INSTANCE":
                self._begin_instance(block)
            case "END PART" | "END ASSEMBLY" | "END INSTANCE":
                self._current = self._current[:-1] or [self._flat]
            case "NODE":
                self._add_nodes(block, part)
            case "ELEMENT":
                self._add_elements(block, part)
            case "NSET" | "ELSET" as key:
                self._add_set(block, key, part)
            case keyword if keyword in _MAKERS:
                remedy = "remedy: a file in which all nodes and elements are listed, as Abaqus/CAE writes it"
                raise self._defect(f"line {block.line}: *{keyword.title()} is not read; {remedy}")

    def _defect(self, text: str) -> MeshError:
        return MeshError(self._heading, [text])

    def _begin_instance(self, block: Block) -> None:
        name = block.name("PART").upper()
        if "LIBRARY" in block.parameters or name not in self._parts:
            text = f"line {block.line}: *Instance of the part {block.name('PART')!r}, which this file does not contain"
            raise self._defect(f"{text}; remedy: an input file with all of its parts")
        self._used.add(name)
        numbers = [[_real(value) for value in row if value] for row in block.rows]
        placed = self._parts[name].copy()
        if numbers:
            placed.shift = np.array((numbers[0] + [0.0, 0.0, 0.0])[:3])
        if len(numbers) > 1:
            first, second, angle = np.array(numbers[1][:3]), np.array(numbers[1][3:6]), numbers[1][6]
            axis = second - first
            if not np.linalg.norm(axis) > 0.0:
                raise self._defect(
                    f"line {block.line}: the axis of *Instance has no length; remedy: two different points"
                )
            placed.turn = Rotation.from_rotvec(np.radians(angle) * axis / np.linalg.norm(axis))
            placed.centre = first
        self._instances[block.name("NAME")] = placed
        self._current.append(placed)

    def _add_nodes(self, block: Block, part: _Part) -> None:
        if block.name("SYSTEM").upper() not in ("", "R"):
            raise self._defect(f"line {block.line}: nodes in cylindrical or spherical coordinates; allowed: x, y, z")
        for row in block.rows:
            part.nodes[int(row[0])] = tuple((*(_real(value or "0") for value in row[1:4]), 0.0, 0.0))[:3]
        if name := block.name("NSET"):
            part.sets["NSET"].setdefault(name, []).extend(int(row[0]) for row in block.rows)

    def _add_elements(self, block: Block, part: _Part) -> None:
        kind = block.name("TYPE").upper()
        found = _SOLID.fullmatch(kind)
        if found is None:
            part.elements |= {int(row[0]): (kind, []) for row in block.rows if row[0].isdigit()}
            return
        size = int(found.group(1)) + 1
        if size - 1 not in _SOLIDS:
            text = f"line {block.line}: elements of type {kind}"
            raise self._defect(f"{text}; allowed: C3D4, C3D8, C3D10 and their variants; remedy: mesh it with these")
        for row in _rows_of([[int(value) for value in row if value] for row in block.rows], size):
            part.elements[row[0]] = kind, row[1:]
            if len(row) != size:
                text = f"line {block.line}: element {row[0]} of type {kind} has {len(row) - 1} nodes"
                raise self._defect(f"{text}; allowed: {size - 1}; the file seems cut off; remedy: export it again")
            if name := block.name("ELSET"):
                part.sets["ELSET"].setdefault(name, []).append(row[0])

    def _add_set(self, block: Block, key: str, part: _Part) -> None:
        owner = block.name("INSTANCE")
        if owner:
            part = self._instance(owner, block)
        sets = part.sets[key]
        ids = sets.setdefault(block.name(key), [])
        if key == "NSET" and (source := block.name("ELSET")):
            ids += [
                node
                for element in self._members(part.sets["ELSET"], source, block)
                for node in part.elements[element][1]
            ]
        rows = [[value for value in row if value] for row in block.rows]
        if "GENERATE" in block.parameters:
            for row in rows:
                first, last, by = int(row[0]), int(row[1]), int(row[2]) if len(row) > 2 else 1
                ids.extend(range(first, last + 1, by))
            return
        for item in (value for row in rows for value in row):
            self._add_member(item, block, key, sets, everywhere=part is self._assembly)

    def _add_member(self, name: str, block: Block, key: str, sets: dict[str, list[int]], *, everywhere: bool) -> None:
        """Add a member to the set that a block defines: the number of a node or an element, or the name of a set.

        ``INSTANCE.MEMBER`` belongs to an instance. If ``everywhere``, a name without an instance is looked up in the
        assembly and in all instances.
        """
        owner, _, item = name.rpartition(".")
        places = [self._instance(owner, block).sets[key]] if owner else [sets]
        if everywhere and not owner and not item.isdigit():
            parts = [self._assembly, *self._instances.values()]
            places = [part.sets[key] for part in parts if _find_set(part.sets[key], item)] or [sets]
        for there in places:
            found = [int(item)] if item.isdigit() else self._members(there, item, block)
            there.setdefault(block.name(key), []).extend(found)

    def _instance(self, owner: str, block: Block) -> _Part:
        known = {name.upper(): item for name, item in self._instances.items()}
        if owner.upper() not in known:
            text = f"line {block.line}: a set of the instance {owner!r}, which is not there"
            raise self._defect(f"{text}; remedy: define the instance before this line")
        return known[owner.upper()]

    def _members(self, sets: dict[str, list[int]], name: str, block: Block) -> list[int]:
        ids = _find_set(sets, name)
        if ids is None:
            raise self._defect(f"line {block.line}: the set {name!r} is not there; remedy: define it before this line")
        return list(ids)

    def mesh(self) -> RawMesh:
        """Return the mesh of all instances, or of the nodes and elements outside of parts."""
        placed = list(self._instances.items())
        if not self._instances:
            if len(self._parts) > 1 or (self._parts and self._flat.elements):
                names = ", ".join(self._parts)
                raise self._defect(
                    f"the parts {names} have no instance; remedy: an *Assembly with an *Instance of each"
                )
            placed = [("", each) for each in (*self._parts.values(), self._flat) if each.elements]
        else:
            idle = [name for name in self._parts if name not in self._used]
            self._remarks += [f"part {name} has no instance and is left out" for name in idle]
            if self._flat.elements:
                placed.append(("", self._flat))
        if self._assembly.elements:
            self._remarks.append(f"{len(self._assembly.elements)} elements of the assembly itself are left out")
        return self._join(placed)

    def _join(self, placed: list[tuple[str, _Part]]) -> RawMesh:
        """Return one mesh of the named parts; if there are several, each is also a set of cells."""
        points, cells, cell_sets, point_sets = [np.zeros((0, 3))], {}, {}, {}
        left_out: dict[str, int] = {}
        for name, part in placed:
            start = sum(map(len, points))
            row = {number: start + k for k, number in enumerate(part.nodes)}
            points.append(part.points())
            places = self._add_cells(part, row, cells, left_out)
            own = {name: list(part.elements)} if name and len(placed) > 1 else {}
            for key, numbers in (*part.sets["ELSET"].items(), *own.items()):
                for kind, place in (places[number] for number in numbers if number in places):
                    cell_sets.setdefault(key, {}).setdefault(kind, []).append(place)
            for key, numbers in part.sets["NSET"].items():
                point_sets.setdefault(key, []).extend(row[number] for number in numbers if number in row)
        given = [f"{count} elements of type {kind} are" for kind, count in left_out.items()]
        return RawMesh(
            points=np.concatenate(points),
            cells=[CellBlock(kind, np.array(block, dtype=np.int64)) for kind, block in cells.items()],
            cell_sets={
                key: [np.array(per.get(kind, []), dtype=np.int64) for kind in cells] for key, per in cell_sets.items()
            },
            point_sets={key: np.array(ids, dtype=np.int64) for key, ids in point_sets.items()},
            remarks=[*self._remarks, *(f"{text} left out, because they are no solids" for text in given)],
        )

    def _add_cells(
        self, part: _Part, row: dict[int, int], cells: dict[str, list[list[int]]], left_out: dict[str, int]
    ) -> dict[int, tuple[str, int]]:
        """Add a part's solid elements to the blocks of ``cells``, and count its other elements in ``left_out``.

        ``row`` is a dict from node number to index in the mesh. Returns a dict from the number of each solid to the
        kind of its block and its index in the block.
        """
        places: dict[int, tuple[str, int]] = {}
        for number, (kind, nodes) in part.elements.items():
            if _SOLID.fullmatch(kind) is None:
                left_out[kind] = left_out.get(kind, 0) + 1
                continue
            if missing := [node for node in nodes if node not in row]:
                text = f"element {number} has the node {missing[0]}, which is not there"
                raise self._defect(f"{text}; remedy: export it again")
            block = cells.setdefault(_SOLIDS[len(nodes)], [])
            places[number] = _SOLIDS[len(nodes)], len(block)
            block.append([row[node] for node in nodes])
        return places


def _find_set(sets: dict[str, list[int]], name: str) -> list[int] | None:
    """Return the set with this name in upper or lower case; None if there is no such set."""
    return next((ids for key, ids in sets.items() if key.upper() == name.strip('"').upper()), None)


def _real(text: str) -> float:
    """Convert a number in Fortran's notation: 1.5, 1.5e-3, 1.5D-3."""
    return float(text.upper().replace("D", "E"))


def _rows_of(numbers: list[list[int]], size: int) -> Iterable[list[int]]:
    """Yield the ``size`` numbers of each element, joined from one or more data lines.

    If the file is cut off, the last element may have fewer numbers.
    """
    kept: list[int] = []
    for row in numbers:
        kept += row
        if len(kept) >= size:
            yield kept
            kept = []
    if kept:
        yield kept

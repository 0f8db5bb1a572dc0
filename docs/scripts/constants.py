# SPDX-License-Identifier: Apache-2.0
"""The constants that decide about results, with their reasons, read from the code and its docstrings."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.markdown import markdown_table

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("solver", "actuators", "constraints", "materials", "mesh")
LAYOUTS = ("blocks", "lanes")
"""Modules whose constants number rows and columns."""
REASONS = {
    "ARMIJO": "Share of the decrease predicted by the slope that a step must achieve: the usual value.",
    "MAX_CUTS": "Number of halvings of a step after which the descent counts as stalled: 2^-30 is below any rounding.",
    "ROUNDING": "Share of the sum of the energy's terms; smaller changes are rounding errors in double precision.",
    "CURVATURE": "Least cosine between a step and the change of the gradient for the pair to enter the history.",
    "MEMORY": "Number of pairs that the acceleration keeps.",
    "GROWTH": "Growth of the residual after which Anderson's history is dropped and a plain step follows.",
    "CHUNK": "Number of iterations in one compiled call, between two checks of the deadline.",
    "FIRST_TOLERANCE": "Tolerance of the first descent: pressures and shares are still far off, so more is wasted.",
    "TIGHTEN": "Factor on the tolerance from one descent to the next, down to the requested one.",
    "MAX_UPDATES": "Number of updates of pressures and shares after which a step is returned as not settled.",
    "NEWTON_STEPS": "Limit of a Newton iteration for a scalar or a point; it usually takes three to five steps.",
    "LARGEST_RATIO": "Largest share of the last motion that the first guess of a step repeats.",
    "SMOOTH": "Largest share of a motion that may be new if it is to count as a repetition of the last one.",
    "LARGEST_TURN": "Largest turn of a handle in one increment: below 180 degrees the nearest turn is unambiguous.",
    "MOST_SWINGS": "Number of oscillations in a row after which the bulk modulus beside the pressures is raised.",
    "FIRST": "First change of a command for a finite difference, as a share of its range or size.",
    "SMALLEST": "Smallest change of a command for a finite difference.",
    "SIZINGS": "Number of times that the change of a command is chosen again.",
    "ROUNDS": "Number of corrections of turns after which a step is returned with the remaining moments.",
    "MOST_REPEATED": "Largest share of the last turn that the first guess of a step repeats.",
    "NEIGHBOURS": "Number of cells with the nearest centres that are searched for the one around a point.",
    "GAUSS": "Coordinate of the two integration points of each direction.",
    "DEGENERATE": "Share of the size: if two signed stretches cancel to this, a rotation is not unique.",
}
"""Of constants that have no docstring in the code."""


@dataclass(frozen=True)
class Constant:
    """Constants of one assignment: in what room and module, names and values as written, and why they are that."""

    room: str
    module: str
    names: tuple[str, ...]
    values: tuple[str, ...]
    reason: str


def constants() -> list[Constant]:
    """Find the named numbers at the top of the modules, in the order of the modules."""
    paths = ((room, path) for room in ROOMS for path in sorted((ROOT / "gdfe_ros" / room).rglob("*.py")))
    return [found for room, path in paths if path.stem not in LAYOUTS for found in _of_module(room, path)]


def constant_table() -> str:
    """Return a table for each room."""
    parts = []
    for room in ROOMS:
        rows = [
            ("<br>".join(f"`{name}`" for name in item.names), "<br>".join(item.values), item.reason, f"`{item.module}`")
            for item in constants()
            if item.room == room
        ]
        if rows:
            parts.append(f"### {room}\n\n{markdown_table(('constant', 'value', 'reason', 'module'), rows)}")
    return "\n\n".join(parts)


def _of_module(room: str, path: Path) -> Iterator[Constant]:
    text = path.read_text(encoding="utf-8")
    lines, body = text.splitlines(), ast.parse(text).body
    for node, after in zip(body, [*body[1:], None], strict=True):
        if not isinstance(node, ast.Assign) or len(node.targets) != 1:
            continue
        target, several = node.targets[0], isinstance(node.value, ast.Tuple) and isinstance(node.targets[0], ast.Tuple)
        values = node.value.elts if several else [node.value]
        names = tuple(ast.unparse(item) for item in (target.elts if several else [target]))
        if not all(name.isupper() and name[0] != "_" for name in names) or not all(map(_is_number, values)):
            continue
        if several and _numbers(values):
            continue
        given = after.value.value if _is_text(after) else _comment(lines, node.lineno) or REASONS.get(names[0], "")
        reason = " ".join(str(given).split()).replace("|", "\\|").replace("``", "`")
        yield Constant(room, path.stem, names, tuple(ast.unparse(value) for value in values), reason)


def _comment(lines: list[str], number: int) -> str:
    """Return the comment ``#: ...`` above a line."""
    first = last = number - 1
    while first and lines[first - 1].startswith("#:"):
        first -= 1
    return " ".join(line.removeprefix("#:").strip() for line in lines[first:last])


def _is_number(node: ast.expr) -> bool:
    """Tell whether an expression is a number: literals, sums and products, turns in degrees, tuples of them."""
    if isinstance(node, ast.Constant):
        return type(node.value) in (int, float)
    if isinstance(node, ast.Tuple):
        return all(map(_is_number, node.elts))
    if isinstance(node, ast.BinOp):
        return _is_number(node.left) and _is_number(node.right)
    if isinstance(node, ast.UnaryOp):
        return _is_number(node.operand)
    return isinstance(node, ast.Call) and ast.unparse(node.func) == "np.deg2rad"


def _numbers(values: list[ast.expr]) -> bool:
    """Tell whether values only number something: 0, 1, 2 ..."""
    return [ast.unparse(value) for value in values] == [str(k) for k in range(len(values))]


def _is_text(node: ast.stmt | None) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)

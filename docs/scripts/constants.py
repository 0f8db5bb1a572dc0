# SPDX-License-Identifier: Apache-2.0
"""The constants that influence results, with their explanations, read from the code and its docstrings."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.markdown import markdown_table

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("solver", "paper", "arms", "actuators", "constraints", "materials", "mesh")
LAYOUTS = ("blocks", "lanes")
"""Modules whose constants are only numbers of rows and columns."""


@dataclass(frozen=True)
class Constant:
    """Constants of one assignment: folder (room) and module, names and values as in the code, and explanation."""

    room: str
    module: str
    names: tuple[str, ...]
    values: tuple[str, ...]
    reason: str


def constants() -> list[Constant]:
    """Return the numeric constants of all modules and their classes, in the order of the modules."""
    paths = ((room, path) for room in ROOMS for path in sorted((ROOT / "gdfe_ros" / room).rglob("*.py")))
    return [found for room, path in paths if path.stem not in LAYOUTS for found in _of_module(room, path)]


def constant_table() -> str:
    """Return a Markdown table for each of `ROOMS`."""
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
    classes = (node for node in body if isinstance(node, ast.ClassDef))
    bodies = [body, *(node.body for node in classes if not any("Enum" in ast.unparse(base) for base in node.bases))]
    for node, after in (pair for each in bodies for pair in zip(each, [*each[1:], None], strict=True)):
        if not isinstance(node, ast.Assign) or len(node.targets) != 1:
            continue
        target, several = node.targets[0], isinstance(node.value, ast.Tuple) and isinstance(node.targets[0], ast.Tuple)
        values = node.value.elts if several else [node.value]
        names = tuple(ast.unparse(item) for item in (target.elts if several else [target]))
        if not all(name.isupper() and name[0] != "_" for name in names) or not all(map(_is_number, values)):
            continue
        if several and _numbers(values):
            continue
        given = after.value.value if _is_text(after) else _comment(lines, node.lineno)
        reason = " ".join(str(given).split()).replace("|", "\\|").replace("``", "`")
        yield Constant(room, path.stem, names, tuple(ast.unparse(value) for value in values), reason)


def _comment(lines: list[str], number: int) -> str:
    """Return the comment ``#: ...`` above line ``number``."""
    first = last = number - 1
    while first and lines[first - 1].startswith("#:"):
        first -= 1
    return " ".join(line.removeprefix("#:").strip() for line in lines[first:last])


def _is_number(node: ast.expr) -> bool:
    """Return whether an expression is a number: a literal, sum, product, angle in degrees, or a tuple of these."""
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
    """Return whether the values are only the indices 0, 1, 2 ..."""
    return [ast.unparse(value) for value in values] == [str(k) for k in range(len(values))]


def _is_text(node: ast.stmt | None) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)

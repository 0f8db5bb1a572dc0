# SPDX-License-Identifier: Apache-2.0
"""The keys of a scene file as Markdown: the reference in docs/scene.md, generated so that it cannot become outdated.

``python -m docs.scripts.scene_reference`` prints it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from enum import Enum
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin

import yaml
from pydantic.fields import FieldInfo

from benchmarks.markdown import markdown_table
from docs.scripts.scene_examples import EXAMPLES
from gdfe_ros.actuators import Mode
from gdfe_ros.constraints.form import Box, Sphere
from gdfe_ros.keys import Alternatives
from gdfe_ros.mesh.selection import BoxSelection, SphereSelection
from gdfe_ros.quantity import ANY, Quantity, find_quantity
from gdfe_ros.scene.report import bare, description_of, fields_of, quantity_of
from gdfe_ros.scene.schemas.actuator_schema import ActuatorModel
from gdfe_ros.scene.schemas.scene_schema import SceneModel
from gdfe_ros.solver.settings import SolverSettings

_TITLES = {
    Sphere: "Sphere obstacle",
    Box: "Box obstacle",
    SphereSelection: "Sphere",
    BoxSelection: "Box",
    SolverSettings: "Solver",
}
"""Titles of entries other than the names of their classes."""
_WORDS = {float: "number", int: "whole number", bool: "true or false", str: "text"}


def markdown() -> str:
    """Return Markdown with a section for each kind of entry: its meaning, its keys, and examples."""
    return "\n".join(_section(model) for model in models())


def mode_table() -> str:
    """Return a Markdown table of the modes of each kind of actuator: units, readings, and fields of JointState."""
    rows = []
    for kind, field in ActuatorModel.model_fields.items():
        model = bare(field.annotation)
        modes = get_args(model.model_fields["command"].annotation) if "command" in model.model_fields else [model.mode]
        for mode in map(Mode, modes):
            command = "effort" if mode.by_effort else "position"
            pairs = (mode.value, mode.unit), (mode.extent, mode.extent_unit), (mode.effort, mode.effort_unit)
            texts = [f"{name} [{unit or 1}]" if name else "0" for name, unit in (*pairs, mode.position)]
            rows.append((f"`{kind}`", *texts[:3], f"`{command}`", texts[3]))
    heads = ("actuator", "command", "extent", "effort", "command on `~/actuation`", "`position` on `~/joint_states`")
    return markdown_table(heads, rows)


def models() -> list[type]:
    """Return the kinds of entries, starting with the whole file; each kind comes before the kinds that it contains."""
    found: list[type] = [SceneModel]
    for model in found:
        for field in fields_of(model).values():
            found += [inner for inner in _inside(field.annotation) if inner not in found]
    return found


def meaning_of(field: FieldInfo) -> str:
    """Return the meaning of a key: the description of its field, or the meaning of its number or of its entry."""
    quantity = quantity_of(field)
    inner = next(iter(_inside(field.annotation)), None)
    if text := description_of(field):
        return text
    return quantity.meaning if quantity else _summary(inner) if inner else ""


def _section(model: type) -> str:
    head = ("key", "what it is", "form", "unit", "range", "default")
    only = issubclass(model, Alternatives)
    rows = (_row(name, field, optional=only) for name, field in fields_of(model).items())
    lines = [f"### {_title(model)}", "", _summary(model)]
    if only and model.options:
        lines[-1] += f" Further keys: {', '.join(f'`{name}`' for name in model.options)}."
    lines += ["", *(f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows)), ""]
    whole = [example for example in EXAMPLES[model] if "\n" in example]
    short = [example for example in EXAMPLES[model] if "\n" not in example]
    blocks = [*whole, *(["\n# or\n".join(short)] if short else [])]
    return "\n".join([*lines, "\n\n".join(f"```yaml\n{block.strip()}\n```" for block in blocks), ""])


def _row(name: str, field: FieldInfo, *, optional: bool) -> tuple[str, ...]:
    quantity = quantity_of(field)
    unit, bounds = (quantity.unit, _range(quantity)) if quantity else ("", "")
    default = "required" if field.is_required() else "" if optional and field.default is None else _value(field.default)
    return f"`{name}`", meaning_of(field), _form(field.annotation, quantity), unit, bounds, default


def _form(annotation: Any, quantity: Quantity | None) -> str:
    """Return the form of a value in words: a number, a choice of words, an entry (with a link), a list or a mapping."""
    if quantity is not None:
        noun = "whole number" if quantity.whole else "number"
        return noun if quantity.count is None else f"{'' if quantity.count == ANY else quantity.count} {noun}s".strip()
    annotation, arguments = bare(annotation), get_args(bare(annotation))
    origin = get_origin(annotation)
    if origin is Literal:
        return " or ".join(f"`{word}`" for word in arguments)
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        return " or ".join(f"`{item.value}`" for item in annotation)
    if fields_of(annotation):
        return f"[{_title(annotation)}](#{_anchor(annotation)})"
    if origin in (Union, UnionType):
        return " or ".join(_form(choice, find_quantity(choice)) for choice in arguments)
    if origin is dict:
        return f"name: {_form(arguments[1], find_quantity(arguments[1]))}"
    if origin is tuple:
        return f"list of {_form(arguments[0], find_quantity(arguments[0]))}"
    return _WORDS.get(annotation, "path")


def _range(quantity: Quantity) -> str:
    low = quantity.above if quantity.above is not None else quantity.least
    high = quantity.below if quantity.below is not None else quantity.most
    parts = []
    if low is not None:
        parts.append(f"{'>' if quantity.above is not None else '≥'} {low:g}")
    if high is not None:
        parts.append(f"{'<' if quantity.below is not None else '≤'} {high:g}")
    return ", ".join([*parts, "ascending"] if quantity.ascending else parts)


def _value(value: Any) -> str:
    """Return a default as YAML."""
    if value is None or value == "" or value == () or value == {}:
        return "none"
    if fields_of(type(value)):
        return "as below"
    if isinstance(value, tuple) and all(isinstance(item, Enum) for item in value):
        return "all of them"
    plain = value.value if isinstance(value, Enum) else list(value) if isinstance(value, tuple) else value
    return f"`{yaml.safe_dump(plain, default_flow_style=True).splitlines()[0]}`"


def _inside(annotation: Any) -> Iterator[type]:
    """Yield the kinds of entries that an annotation contains."""
    if fields_of(annotation):
        yield annotation
        return
    arguments: Iterable[Any] = get_args(annotation)
    for argument in arguments:
        yield from _inside(argument)


def _summary(model: type) -> str:
    return " ".join((model.__doc__ or "").split("\n\n")[0].split())


def _title(model: type) -> str:
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", model.__name__.removesuffix("Model"))
    return _TITLES.get(model, words.capitalize())


def _anchor(model: type) -> str:
    return _title(model).lower().replace(" ", "-")


if __name__ == "__main__":
    print(markdown(), end="")

# SPDX-License-Identifier: Apache-2.0
"""YAML text as plain data, with the line of every entry and the duplicate keys."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import yaml

from gdfe_ros.errors import SceneError
from gdfe_ros.untrusted.bounded_text import MOST_NODES, Loader, check_yaml, load_yaml

KeyPath = tuple[str | int, ...]
Carried = dict[KeyPath, dict[str, Any]]
"""Dict from key path to scene entry in which file names are replaced by the files' contents; meshes precede skins."""
_LONGEST_SHOWN = 80
"""Largest number of characters of a line that an error shows."""


@dataclass(frozen=True)
class Document:
    """Parsed YAML text.

    Attributes:
        data: the top-level mapping; every key is text, as in the file.
        lines: dict from the key path of each entry to its line, counted from 1.
        duplicates: key paths that the file gives more than once; `data` has the last value.
        overridden: key paths whose value was replaced after reading.
    """

    data: dict[str, Any]
    lines: dict[KeyPath, int] = field(default_factory=dict)
    duplicates: list[KeyPath] = field(default_factory=list)
    overridden: set[KeyPath] = field(default_factory=set)

    def line(self, path: KeyPath) -> int | None:
        """Return the line of an entry, or of the closest entry that contains it; None if there is none."""
        while path and path not in self.lines:
            path = path[:-1]
        return self.lines.get(path)

    def is_overridden(self, path: KeyPath) -> bool:
        """Return whether an entry, or an entry that contains it, was replaced after reading."""
        return any(path[: i + 1] in self.overridden for i in range(len(path)))


def parse_document(text: str, *, heading: str, most_nodes: int = MOST_NODES) -> Document:
    """Return the document of a YAML text.

    Args:
        text: the YAML text.
        heading: name of the text in an error, e.g. ``scene bend5.yaml``.
        most_nodes: largest number of values.

    Raises:
        SceneError: the text is not YAML, exceeds a limit of `bounded_text`, is empty, or its top level is not a
            mapping.
    """
    reader = None
    try:
        check_yaml(text, most_nodes=most_nodes)
        reader = Loader(text)
        node = reader.get_single_node()
        if node is None:
            raise SceneError(heading, ["the file is empty; it needs name, mesh, materials, regions and handles"])
        document = Document({})
        data = _construct(reader, node, (), document)
    except yaml.YAMLError as error:
        raise SceneError(heading, [_explain(error, text)]) from error
    finally:
        if reader is not None:
            reader.dispose()
    if not isinstance(data, dict):
        kind = {list: "a list", str: "one piece of text"}.get(type(data), f"{data!r}")
        raise SceneError(heading, [f"the top level is {kind}; it must be a mapping: name, mesh, ..."])
    document.data.update(data)
    return document


def parse_value(text: str) -> Any:
    """Return the value of an override, given as text like a value in a scene file: ``0.49``, ``[40, 10, 10]``.

    Raises:
        ValueError: the text is not YAML.
    """
    try:
        return load_yaml(text)
    except yaml.YAMLError as error:
        raise ValueError(_explain(error, text)) from error


def write_document(data: dict[str, Any]) -> str:
    """Return data as YAML text, from which `parse_document` reads equal data."""
    layout = {"sort_keys": False, "default_flow_style": None, "width": 110, "allow_unicode": True}
    return yaml.dump(data, Dumper=getattr(yaml, "CSafeDumper", yaml.SafeDumper), **layout)


def without(entry: dict[str, Any], *keys: str) -> dict[str, Any]:
    """Return a copy of an entry without some of its keys."""
    return {key: value for key, value in entry.items() if key not in keys}


def _construct(reader: Loader, node: yaml.Node, path: KeyPath, document: Document) -> Any:
    document.lines.setdefault(path, node.start_mark.line + 1)
    if isinstance(node, yaml.SequenceNode):
        return [_construct(reader, item, (*path, i), document) for i, item in enumerate(node.value)]
    if not isinstance(node, yaml.MappingNode):
        try:
            return reader.construct_object(node, deep=True)
        except ValueError as error:  # e.g. a date that does not exist
            raise yaml.constructor.ConstructorError(None, None, str(error), node.start_mark) from error
    seen = set()
    for key_node, _ in node.value:
        if not isinstance(key_node, yaml.ScalarNode):
            raise yaml.constructor.ConstructorError(None, None, "a key must be a word", key_node.start_mark)
        if key_node.value in seen:
            document.duplicates.append((*path, key_node.value))
            document.lines[document.duplicates[-1]] = key_node.start_mark.line + 1
        seen.add(key_node.value)
    reader.flatten_mapping(node)
    result = {}
    for key_node, value_node in node.value:
        key = key_node.value
        document.lines.setdefault((*path, key), key_node.start_mark.line + 1)
        result[key] = _construct(reader, value_node, (*path, key), document)
    return result


def _explain(error: yaml.YAMLError, text: str) -> str:
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    if mark is None:
        return f"this is not YAML: {str(error).splitlines()[0][:_LONGEST_SHOWN]}"
    lines = text.splitlines()
    begin = max(0, mark.column - _LONGEST_SHOWN // 2)
    shown = lines[mark.line][begin : begin + _LONGEST_SHOWN].strip() if mark.line < len(lines) else ""
    problem = " ".join(filter(None, (getattr(error, "context", None), getattr(error, "problem", None))))
    hint = "; indent with spaces, not tabs" if mark.line < len(lines) and "\t" in lines[mark.line] else ""
    return f"line {mark.line + 1}, column {mark.column + 1}: this is not YAML: {problem}{hint}: {shown!r}"

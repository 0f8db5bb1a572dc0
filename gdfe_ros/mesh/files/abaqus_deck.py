# SPDX-License-Identifier: Apache-2.0
"""Abaqus input files as blocks: a keyword with its parameters, and the data lines below it.

meshio cannot be used: it keeps only the nodes of the last part, and ignores instances. This reader follows the Abaqus
keywords reference.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.files.mesh_input import LARGEST
from gdfe_ros.untrusted.regular_file import is_file, read_bytes

MOST_INCLUDES = 100
"""Largest number of included files; beyond it, the file is taken to include itself."""


@dataclass(frozen=True, eq=False)
class Block:
    """A keyword line of an input file, and the data lines that follow it.

    Attributes:
        keyword: in capitals, without the asterisk and without repeated spaces, e.g. ``END PART``.
        parameters: dict from parameter, in capitals, to its value; an empty text for a parameter without a value.
        line: number of the keyword's line, from 1.
        rows: data lines, each split at its commas, without spaces around the values.
    """

    keyword: str
    parameters: dict[str, str]
    line: int
    rows: list[list[str]] = field(default_factory=list)

    def name(self, parameter: str) -> str:
        """Return the value of a parameter that is a name. Abaqus ignores its case, and spaces around it."""
        return self.parameters.get(parameter, "").strip('"')


def read_blocks(path: Path, heading: str) -> list[Block]:
    """Return the blocks of an input file and of the files that it includes.

    Raises:
        MeshError: the file is not text, has data before the first keyword, or includes a file that does not exist.
    """
    return list(_blocks(path, heading, []))


def _blocks(path: Path, heading: str, included: list[Path]) -> Iterator[Block]:
    block: Block | None = None
    for number, line in _join_lines(path, heading):
        if not line.startswith("*"):
            if block is None:
                text = f"line {number} is {line[:40]!r}, before the first keyword"
                raise MeshError(
                    heading, [f"{text}; allowed: an Abaqus input file, which begins with *Heading or *Node"]
                )
            block.rows.append([part.strip() for part in line.split(",")])
            continue
        if block is not None:
            yield block
        block = _keyword(line, number)
        if "INPUT" not in block.parameters:
            continue
        other = path.parent / block.name("INPUT")
        included.append(other)
        if not is_file(other) or len(included) > MOST_INCLUDES:
            why = "there is no such file" if not is_file(other) else "it includes itself"
            text = f"line {number}: *{block.keyword.title()} of {block.name('INPUT')[:200]!r}: {why}"
            raise MeshError(heading, [f"{text}; remedy: put it beside this file"])
        if block.keyword == "INCLUDE":
            yield from _blocks(other, heading, included)
        else:
            lines = _join_lines(other, heading)
            block.rows.extend([part.strip() for part in line.split(",")] for _, line in lines)
    if block is not None:
        yield block


def _join_lines(path: Path, heading: str) -> Iterator[tuple[int, str]]:
    """Yield the number and the text of each line without comments; keyword lines that end in a comma are joined."""
    try:
        text = read_bytes(path, most=LARGEST).decode("utf-8-sig", errors="replace")
    except OSError as error:
        raise MeshError(heading, [f"cannot be read: {error.strerror or error}"]) from error
    if "\0" in text:
        raise MeshError(heading, ["this is a binary file, no Abaqus input file; remedy: the .inp file of the job"])
    kept, begun = "", 0
    for number, line in enumerate(text.splitlines(), start=1):
        line = line.strip()
        if not line or line.startswith("**"):
            continue
        kept, begun = (kept + line, begun) if kept else (line, number)
        if kept.startswith("*") and kept.endswith(","):
            continue
        yield begun, kept
        kept = ""
    if kept:
        yield begun, kept


def _keyword(line: str, number: int) -> Block:
    head, *given = line[1:].split(",")
    pairs = (item.partition("=") for item in given if item.strip())
    parameters = {"".join(key.split()).upper(): value.strip() for key, _, value in pairs}
    return Block(" ".join(head.split()).upper(), parameters, number)

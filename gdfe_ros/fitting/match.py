# SPDX-License-Identifier: Apache-2.0
"""Reader of a match file, which states the file of each recording and the options for reading it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import ValidationError

from gdfe_ros.bounded_text import LARGEST_TEXT
from gdfe_ros.errors import DefectsError, GdfeError
from gdfe_ros.fitting.match_schema import MatchModel, RecordingModel
from gdfe_ros.regular_file import read_text
from gdfe_ros.scene.document import parse_document
from gdfe_ros.scene.entry import TAG


class MatchError(DefectsError):
    """A match file that is invalid, or does not fit the recordings."""


@dataclass(frozen=True)
class Source:
    """A recording to read.

    Attributes:
        name: name of the recording.
        path: path of a CSV file or a bag.
        match: options for reading it.
    """

    name: str
    path: Path
    match: RecordingModel


def find_sources(data: Sequence[Path], match: Path | None) -> list[Source]:
    """Return the recordings in files and bags, with their options from the match file.

    If the match file has no key `recordings`, each file is one recording with the name of the file. Otherwise every
    file must belong to at least one entry of `recordings`. Several recordings may use different rows of one file.
    Recordings whose file is not in ``data`` are left out.

    Raises:
        MatchError: the match file has defects; all are listed.
        GdfeError: a file does not exist, or two files have the same name.
    """
    _require_distinct(data)
    shared, own = _read(match) if match else ({}, {})
    heading = f"match file {match}"
    files = {path.stem: path for path in data} | {path.name: path for path in data}
    sources = []
    for name, entry in own.items():
        path = files.get(str(entry.get("file", name)))
        if path is not None:
            sources.append(Source(name, path, _validated({**shared, **entry}, heading, f"recordings.{name}")))
    taken = {source.path for source in sources}
    rest = [path for path in data if path not in taken]
    if own and rest:
        text = f"no recording takes {', '.join(path.name for path in rest)}; recordings: {', '.join(own)}"
        raise MatchError(heading, [f"recordings: {text}; remedy: name it, or `file: {rest[0].name}` in one of them"])
    return [*sources, *(Source(path.stem, path, _validated(shared, heading, "")) for path in rest)]


def _require_distinct(data: Sequence[Path]) -> None:
    """Raise `GdfeError` if a file does not exist, or if two files have the same name."""
    for path in data:
        if not path.exists():
            raise GdfeError(f"recording {path} does not exist; give CSV files and directories of bags")
    names = [path.stem for path in data]
    if twice := {name for name in names if names.count(name) > 1}:
        raise GdfeError(f"two recordings are named {', '.join(sorted(twice))}; rename a file")


def _read(match: Path) -> tuple[dict[str, object], dict[str, dict[str, object]]]:
    """Return the options for all recordings, and dict from recording to its own options."""
    heading = f"match file {match}"
    try:
        text = read_text(match, most=LARGEST_TEXT)
    except (OSError, UnicodeDecodeError) as error:
        raise MatchError(heading, [f"cannot be read: {error}"]) from error
    shared = dict(parse_document(text, heading=heading).data)
    _validated(shared, heading, "", kind=MatchModel)
    own = shared.pop("recordings", {})
    return shared, own


def _validated(
    data: dict[str, object], heading: str, place: str, *, kind: type[RecordingModel] = RecordingModel
) -> RecordingModel:
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        raise MatchError(heading, [_line(place, item) for item in error.errors(include_url=False)]) from error


def _line(place: str, item: dict) -> str:
    """Return a message about a defect that pydantic found, with its key path."""
    keys = [str(part) for part in item["loc"] if not str(part).startswith(TAG)]
    path = ".".join([*([place] if place else []), *keys])
    if item["type"] == "extra_forbidden":
        return f"{path}: unknown key; keys: {', '.join(RecordingModel.model_fields)}"
    if item["type"] == "literal_error":
        return f"{path}: {item['input']!r} is not allowed; allowed: {item['ctx']['expected']}"
    return f"{path}: {item['msg'].removeprefix('Value error, ')}"

# SPDX-License-Identifier: Apache-2.0
"""Bags of other recorders, read by rosbags: SQLite, ROS 1, and bags that rosbag2 compressed."""

from __future__ import annotations

import shutil
import sqlite3
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.rosbag1 import ReaderError as Ros1Error
from rosbags.rosbag1 import reader as rosbag1_reader
from rosbags.rosbag2 import ReaderError as Ros2Error
from rosbags.rosbag2 import reader as rosbag2_reader
from rosbags.rosbag2 import storage_mcap
from rosbags.typesys import Stores, get_typestore

from gdfe_ros.errors import RecordingError
from gdfe_ros.recording.bag_info import BagKind, TopicInfo, bag_directory, file_kind, is_plain_mcap, storage_files
from gdfe_ros.recording.decoding import bound_libraries, expand_message, open_zstd
from gdfe_ros.recording.reader import BagMessage, BagReader, require_topics

bound_libraries(rosbag1_reader, rosbag2_reader, storage_mcap)
_SUFFIXES = {BagKind.MCAP: ".mcap", BagKind.SQLITE: ".db3", BagKind.ROS1: ".bag"}
_REMEDIES = {
    BagKind.SQLITE: "remedy: `sqlite3 OLD.db3 .recover | sqlite3 NEW.db3`",
    BagKind.ROS1: "remedy: `rosbag reindex FILE.bag`",
    BagKind.ZSTD: "remedy: copy it again from the robot; a compressed file that is cut off cannot be repaired",
}


class ForeignBag:
    """A bag of another recorder: SQLite, ROS 1, compressed by file or by message, one file or several.

    Definitions of messages come from the bag. SQLite bags before ROS 2 Iron have none; their definitions come from ROS
    2 Jazzy. Messages of a ROS 1 bag have the fields of ROS 2, too.

    Args:
        path: directory of the bag, or a file ``.db3``, ``.bag``, ``.mcap``, also with ``.zstd``.

    Raises:
        RecordingError: the bag cannot be read; the error names its kind and the remedy.

    Attributes:
        path: path of the bag.
        kind: kind of its files.
        topics: topics by name.
        counts: number of messages by topic.
        run: None, because these bags are no recordings of this package.
    """

    run = None

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        files = storage_files(self.path)
        if not files:
            raise RecordingError(f"{self.path} is neither a bag directory nor a bag file (.mcap, .db3, .bag)")
        self.kind = file_kind(files[0])
        self._folder = TemporaryDirectory(prefix="gdfe_bag_")
        # Not by metadata.yaml, which rosbags reads without a limit: the files say what they are.
        self._files = [self._name_by_kind(file) for file in files]
        self.topics: dict[str, TopicInfo] = {}
        self.counts: Counter[str] = Counter()
        with self._open() as reader:
            for connection in reader.connections:
                self.topics[connection.topic] = TopicInfo(name=connection.topic, type=connection.msgtype)
                self.counts[connection.topic] += connection.msgcount

    def messages(self, topics: Collection[str] | None = None) -> Iterator[BagMessage]:
        """Yield the messages of ``topics``, or of all topics, in the order of their recording times.

        Raises:
            RecordingError: the bag does not have one of the topics, or is damaged.
        """
        require_topics(self, topics)
        with self._open() as reader:
            chosen = [each for each in reader.connections if topics is None or each.topic in topics]
            for number, (connection, time, data) in enumerate(reader.messages(chosen) if chosen else ()):
                yield BagMessage(connection.topic, connection.msgtype, time, time, number, bytes(data))

    def decoder(self) -> Callable[[str, bytes], Any]:
        """Return a function that returns a message from its type and its bytes.

        The function raises `RecordingError` for a type without a definition, and for bytes that do not fit it.
        """
        with self._open() as reader:
            store, two = reader.typestore, reader.is2

        def decode(kind: str, data: bytes) -> Any:
            if kind not in store.fielddefs:
                text = f"bag {self.path} has no definition of {kind}"
                raise RecordingError(
                    f"{text}; remedy: record it again with ROS 2 Iron or newer, which stores definitions"
                )
            try:
                return store.deserialize_cdr(expand_message(data), kind) if two else store.deserialize_ros1(data, kind)
            except Exception as error:  # the exceptions for invalid bytes are not documented
                raise RecordingError(
                    f"bag {self.path}: {len(data)} bytes do not match the definition of {kind}"
                ) from error

        return decode

    def _name_by_kind(self, file: Path) -> Path:
        """Return a path to a file, with the suffix of the file's kind.

        A compressed file is expanded into a temporary folder. A file with another suffix gets a link in this folder.
        """
        kind, place = file_kind(file), Path(self._folder.name) / file.name
        if kind is BagKind.ZSTD:
            self._expand(file, place)
            return self._name_by_kind(place)
        if kind not in _SUFFIXES:
            raise RecordingError(f"bag file {file} is {kind.value}; remedy: an MCAP file, a .db3 or a .bag")
        if kind is BagKind.SQLITE:
            _require_tables(file)
        if file.suffix == _SUFFIXES[kind]:
            return file
        named = place.with_name(f"{file.stem}_{_SUFFIXES[kind][1:]}{_SUFFIXES[kind]}")
        named.symlink_to(file.resolve())
        return named

    def _expand(self, file: Path, place: Path) -> None:
        from zstandard import ZstdError

        try:
            with file.open("rb") as packed, open_zstd(packed) as content, place.open("wb") as whole:
                shutil.copyfileobj(content, whole)
        except (OSError, ValueError, ZstdError) as error:
            reason = f": {error}" if isinstance(error, ValueError) else ""
            raise RecordingError(f"bag file {file} cannot be expanded{reason}; {_REMEDIES[BagKind.ZSTD]}") from error
        if file_kind(place) not in _SUFFIXES:
            raise RecordingError(f"bag file {file} contains no bag; remedy: a compressed .mcap, .db3 or .bag")

    @contextmanager
    def _open(self) -> Iterator[AnyReader]:
        """Open the bag; replace the errors of rosbags by ``RecordingError``."""
        try:
            with AnyReader(self._files, default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
                yield reader
        except (RecordingError, GeneratorExit):
            raise
        except Exception as error:  # a damaged file raises the exceptions of several libraries
            own = isinstance(error, AnyReaderError | Ros1Error | Ros2Error)
            reason = " ".join(str(error).split())[:200] if own else "its content is damaged or cut off"
            remedy = _REMEDIES.get(self.kind, "remedy: copy it again from the robot")
            raise RecordingError(f"bag {self.path} ({self.kind.value}) cannot be read: {reason}; {remedy}") from error


def _require_tables(file: Path) -> None:
    """Raise an error for a SQLite file with other objects than tables and indices: a view may compute without end.

    Raises:
        RecordingError: there is such an object.
    """
    try:
        with closing(sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro", uri=True)) as connection:
            found = connection.execute("SELECT name, type, sql FROM sqlite_master").fetchall()
    except sqlite3.Error:
        return  # rosbags says what is damaged
    for name, kind, text in found:
        if kind not in ("table", "index") or str(text).upper().startswith("CREATE VIRTUAL"):
            raise RecordingError(f"bag file {file} has the {kind} {str(name)[:80]!r}; allowed: tables and indices")


def open_bag(path: str | Path) -> BagReader | ForeignBag:
    """Return a reader of a bag of any recorder: of plain MCAP files, or of any other kind.

    Raises:
        RecordingError: the bag cannot be read; the error names its kind and the remedy.
    """
    folder = bag_directory(Path(path))
    return BagReader(path) if is_plain_mcap(folder) else ForeignBag(folder)

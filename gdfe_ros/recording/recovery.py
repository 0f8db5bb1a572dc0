# SPDX-License-Identifier: Apache-2.0
"""Repair of bags that a crash, a kill or a full disk truncated."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from mmap import ACCESS_READ, mmap
from pathlib import Path

from mcap.records import Attachment, Channel, McapRecord, Message, Metadata, Schema

from gdfe_ros.errors import RecordingError
from gdfe_ros.recording.bag_info import RUN_RECORD, TopicInfo, bag_directory, require_mcap, storage_files
from gdfe_ros.recording.mcap_records import Damage, declarations, records
from gdfe_ros.recording.provenance import SCENE_FILE, RunInfo
from gdfe_ros.recording.reader import DAMAGE, topic_of
from gdfe_ros.recording.writer import BagWriter


class Salvage:
    """Reads one file record by record. It does not need the file's index, because a truncated file has none.

    Args:
        file: path of the file.

    Attributes:
        damage: damage of the file; complete once ``messages`` has yielded its last message.
        orphans: number of skipped messages of topics without a readable declaration.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        self.damage = Damage()
        self.orphans = 0
        self._schemas: dict[int, Schema] = {}
        self._topics: dict[int, TopicInfo] = {}
        self._metadata: dict[str, dict[str, str]] = {}
        self._attachments: dict[str, bytes] = {}
        self._count: Counter[str] = Counter()
        self._last_sequence: dict[str, int] = {}

    @property
    def run(self) -> RunInfo | None:
        """Origin of the run, known once the first message is read; None without an intact scene.

        If only the metadata record is damaged, the origin still has the scene and the files.
        """
        if SCENE_FILE not in self._attachments:
            return None
        try:
            return RunInfo.from_bag(self._metadata[RUN_RECORD], self._attachments)
        except DAMAGE:
            return RunInfo.from_attachments(self._attachments)

    def restore_scene(self) -> None:
        """Read the scene from the messages of its topic, for use if the attachment is damaged; reads the file again."""
        for topic, message in Salvage(self.file).messages():
            if topic.type == "std_msgs/msg/String" and topic.name.endswith("/scene"):
                # CDR: four bytes of head, the length of the text, the text, a zero.
                self._attachments[SCENE_FILE] = message.data[8:].rstrip(b"\0")
                return

    @property
    def missing(self) -> Counter[str]:
        """Number of lost messages by topic, from gaps in the sequence numbers, which begin at 0 in each file."""
        gaps = {topic: last + 1 - self._count[topic] for topic, last in self._last_sequence.items()}
        return Counter({topic: gap for topic, gap in gaps.items() if gap > 0})

    def messages(self) -> Iterator[tuple[TopicInfo, Message]]:
        """Yield every complete message with its topic, in the order written.

        Raises:
            OSError: the file cannot be read.
        """
        with self.file.open("rb") as stream:
            if not self.file.stat().st_size:
                return
            with mmap(stream.fileno(), 0, access=ACCESS_READ) as data:
                for record in declarations(data):
                    self._declaration(record)
                for record in records(data, self.damage):
                    if isinstance(record, Message):
                        yield from self._message(record)
                    else:
                        self._declaration(record)

    def _message(self, message: Message) -> Iterator[tuple[TopicInfo, Message]]:
        topic = self._topics.get(message.channel_id)
        if topic is None:
            self.orphans += 1
            return
        self._count[topic.name] += 1
        self._last_sequence[topic.name] = max(message.sequence, self._last_sequence.get(topic.name, 0))
        yield topic, message

    def _declaration(self, record: McapRecord) -> None:
        if isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel) and record.schema_id in self._schemas:
            try:
                self._topics[record.id] = topic_of(record, self._schemas[record.schema_id])
            except DAMAGE:
                self._topics.pop(record.id, None)  # its messages count as orphans
        elif isinstance(record, Metadata):
            self._metadata[record.name] = record.metadata
        elif isinstance(record, Attachment):
            self._attachments[record.name] = record.data


@dataclass(frozen=True, kw_only=True)
class RecoveryReport:
    """Result of a recovery.

    Args:
        path: directory of the new bag, complete and indexed.
        messages: number of messages in the new bag, by topic.
        missing: number of lost messages by topic, from gaps in the sequence numbers; messages lost after a topic's last
            recovered message are not counted.
        cut_files: names of truncated files.
        damaged_chunks: number of skipped chunks that did not match their checksum, or whose beginning is destroyed.
        damaged_records: number of other skipped records that could not be read.
        orphans: number of skipped messages of topics without a readable declaration.
        run: whether the new bag has the scene and settings of its run.
    """

    path: Path
    messages: dict[str, int]
    missing: dict[str, int]
    cut_files: tuple[str, ...]
    damaged_chunks: int
    damaged_records: int
    orphans: int
    run: bool

    @property
    def total(self) -> int:
        """Number of messages in the new bag."""
        return sum(self.messages.values())


def recover(path: str | Path, output: str | Path | None = None) -> RecoveryReport:
    """Read a bag as far as possible, write its contents as a new, complete bag, and return a report.

    The old bag is not modified. The run's origin (scene, settings, machine) is copied.

    Args:
        path: directory of the bag or of its run, or one MCAP file.
        output: directory of the new bag; it must not exist yet, or be empty. None: beside the old bag, with
            ``_recovered`` added to the name.

    Raises:
        RecordingError: there is no MCAP file or no complete message, a file cannot be read, or the new bag cannot be
            written.

    Example:
        >>> report = recover("runs/bend5")
        >>> print(report.total, "messages in", report.path)
    """
    source = bag_directory(Path(path))
    files = [source] if source.is_file() else sorted(source.glob("*.mcap"), key=_part_number)
    for file in files or storage_files(source):
        require_mcap(file)
    if not files:
        raise RecordingError(f"there is no MCAP file in {source}: name the directory of a bag")
    target = Path(output) if output else source.resolve().with_name(f"{source.resolve().stem}_recovered")
    salvages = [Salvage(file) for file in files]
    try:
        return _rewrite(source, target, salvages)
    except OSError as error:
        raise RecordingError(f"bag {source} cannot be read: {error}") from error


def _rewrite(source: Path, target: Path, salvages: Sequence[Salvage]) -> RecoveryReport:
    messages = (found for salvage in salvages for found in salvage.messages())
    first = next(messages, None)
    if first is None:
        raise RecordingError(f"bag {source} has not one whole message: there is nothing to recover")
    run = _origin(salvages)
    writer = BagWriter(target, run=run)
    kept: Counter[str] = Counter()
    try:
        for topic, message in chain([first], messages):
            writer.add_topic(topic)
            writer.write(topic.name, message.data, message.log_time, message.publish_time)
            kept[topic.name] += 1
    finally:
        report = RecoveryReport(
            path=target,
            messages=dict(kept),
            missing=dict(sum((salvage.missing for salvage in salvages), Counter())),
            cut_files=tuple(salvage.file.name for salvage in salvages if salvage.damage.cut),
            damaged_chunks=sum(salvage.damage.chunks for salvage in salvages),
            damaged_records=sum(salvage.damage.records for salvage in salvages),
            orphans=sum(salvage.orphans for salvage in salvages),
            run=run is not None,
        )
        notes = {
            "recovered_from": source.resolve().name,
            "messages_written": str(report.total),
            "messages_missing": str(sum(report.missing.values())),
            "damaged_chunks": str(report.damaged_chunks),
        }
        writer.close(notes)
    return report


def _origin(salvages: Sequence[Salvage]) -> RunInfo | None:
    """Return the run's origin from the first file with an intact scene.

    If no attachment with a scene is intact, the origin has only the scene from the topic ``~/scene``. None: no scene.
    """
    if not any(salvage.run for salvage in salvages):
        for salvage in salvages:
            salvage.restore_scene()
    return next((salvage.run for salvage in salvages if salvage.run), None)


def _part_number(file: Path) -> tuple[int, str]:
    number = re.search(r"(\d+)$", file.stem)
    return (int(number[1]) if number else 0, file.name)

# SPDX-License-Identifier: Apache-2.0
"""What can be read of one MCAP file that may break off or be damaged anywhere."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from zstandard import ZstdError

from gdfe_ros.recording.bag_file import RUN_RECORD
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.recording.reader import DAMAGE, topic_of
from gdfe_ros.recording.topic import TopicInfo

# What mcap, lz4 (RuntimeError) and zstandard raise on bytes that are not what they should be.
_DAMAGE = (*DAMAGE, ZstdError)


class Salvage:
    """Reads one file as a stream; the index, which a cut file does not have, is not needed.

    Args:
        file: path of the file.

    Attributes:
        cut: whether the file ends before its proper end; known when ``messages`` is exhausted.
        damaged_chunks: chunks whose content did not match its checksum; left out.
        orphans: messages without their topic's declaration, which lay in a damaged chunk; left out.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        self.cut = True
        self.damaged_chunks = 0
        self.orphans = 0
        self._schemas: dict[int, Schema] = {}
        self._topics: dict[int, TopicInfo] = {}
        self._metadata: dict[str, dict[str, str]] = {}
        self._attachments: dict[str, bytes] = {}
        self._count: Counter[str] = Counter()
        self._last_sequence: dict[str, int] = {}

    @property
    def run(self) -> RunInfo | None:
        """Origin of the run, as far as the file was read; it stands before the first message."""
        if RUN_RECORD not in self._metadata:
            return None
        return RunInfo.from_bag(self._metadata[RUN_RECORD], self._attachments)

    @property
    def missing(self) -> Counter[str]:
        """Messages that sequence numbers, which count from 0 in each file, show to be lost, by topic."""
        gaps = {topic: last + 1 - self._count[topic] for topic, last in self._last_sequence.items()}
        return Counter({topic: gap for topic, gap in gaps.items() if gap > 0})

    def messages(self) -> Iterator[tuple[TopicInfo, Message]]:
        """Yield every whole message with its topic, in the order written.

        Raises:
            OSError: the file cannot be read.
        """
        with self.file.open("rb") as stream:
            for record in self._records(stream):
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
            except _DAMAGE:
                self._topics.pop(record.id, None)  # its messages count as orphans
        elif isinstance(record, Metadata):
            self._metadata[record.name] = record.metadata
        elif isinstance(record, Attachment):
            self._attachments[record.name] = record.data

    def _records(self, stream: BinaryIO) -> Iterator[McapRecord]:
        """Yield records, those inside chunks included, up to the first place that makes no sense."""
        limit = self.file.stat().st_size
        try:
            for record in StreamReader(stream, emit_chunks=True, record_size_limit=limit).records:
                if isinstance(record, Chunk):
                    yield from self._contents(record)
                else:
                    yield record
            self.cut = False
        except _DAMAGE:
            self.cut = True

    def _contents(self, chunk: Chunk) -> list[McapRecord]:
        try:
            return breakup_chunk(chunk, validate_crc=True)
        except _DAMAGE:
            self.damaged_chunks += 1
            return []

# SPDX-License-Identifier: Apache-2.0
"""Salvage of one MCAP file that may be truncated or damaged anywhere."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from mmap import ACCESS_READ, mmap
from pathlib import Path

from mcap.records import Attachment, Channel, McapRecord, Message, Metadata, Schema

from gdfe_ros.recording.bag_file import RUN_RECORD
from gdfe_ros.recording.frames import Damage, declarations, records
from gdfe_ros.recording.provenance import SCENE_FILE, RunInfo
from gdfe_ros.recording.reader import DAMAGE, topic_of
from gdfe_ros.recording.topic import TopicInfo


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

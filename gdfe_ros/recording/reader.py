# SPDX-License-Identifier: Apache-2.0
"""Reading of a finished bag: messages as bytes, topics, and the origin of its run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from mcap.exceptions import McapError
from mcap.reader import McapReader, make_reader
from mcap.records import Channel, Schema

from gdfe_ros.errors import RecordingError
from gdfe_ros.recording.bag_info import (
    LARGEST_METADATA,
    METADATA_FILE,
    RECORDING_RECORD,
    ROLE_KEY,
    ROOT_KEY,
    RUN_RECORD,
    Qos,
    TopicInfo,
    bag_directory,
    require_mcap,
    storage_files,
)
from gdfe_ros.recording.decoding import array_decoder, require_bounded
from gdfe_ros.recording.mcap_records import DAMAGE as UNREADABLE
from gdfe_ros.recording.mcap_records import chunk_size, require_sound_summary
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.untrusted.bounded_text import load_yaml
from gdfe_ros.untrusted.regular_file import quote_path, read_text

_LARGEST_DEFINITION = 200_000
"""Largest size of a type's definition [bytes]; to parse 16 MB takes a minute."""
DAMAGE = (*UNREADABLE, yaml.YAMLError)
"""Exceptions that may occur while a damaged file, or a damaged text in it, is read."""


class BagMessage(NamedTuple):
    """One message of a bag; both times are in nanoseconds, and ``data`` is the serialised message (CDR)."""

    topic: str
    type: str
    log_time: int
    publish_time: int
    sequence: int
    data: bytes


class BagReader:
    """A finished bag, written by this package or by ``ros2 bag record --storage mcap``.

    Args:
        path: directory of the bag or of its run, or one of the bag's MCAP files.

    Raises:
        RecordingError: there is no bag, or it is truncated or damaged (the remedy is ``gdfe recover``).

    Attributes:
        path: path of the bag's directory or file.
        files: MCAP files, in the order in which they were written.
        topics: topics by name.
        counts: number of messages by topic.
        start: smallest log time [ns], 0 for an empty bag.
        end: largest log time [ns].
        run: origin of the run, or None for a bag of another program.
        notes: status of the recording (``RecorderStatus.to_notes``); empty for a bag of another program.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = bag_directory(Path(path))
        self.files = _bag_files(self.path)
        self.topics: dict[str, TopicInfo] = {}
        self.counts: Counter[str] = Counter()
        self.start = self.end = 0
        self.run: RunInfo | None = None
        self.notes: dict[str, str] = {}
        for file in self.files:
            with _open(file) as reader:
                self._survey(reader)

    def __len__(self) -> int:
        return self.counts.total()

    def decoder(self) -> Callable[[str, bytes], Any]:
        """Return a function that returns a message from its type and its bytes (`array_decoder`)."""
        return array_decoder(self.topics.values())

    def messages(self, topics: Collection[str] | None = None) -> Iterator[BagMessage]:
        """Yield the messages of ``topics``, or of all topics, in the order in which they were written.

        Raises:
            RecordingError: the bag does not have one of the topics, or a file is damaged.
        """
        require_topics(self, topics)
        return self._messages(topics)

    def _messages(self, topics: Collection[str] | None) -> Iterator[BagMessage]:
        for file in self.files:
            with _open(file) as reader:
                for _, channel, message in reader.iter_messages(topics, log_time_order=False):
                    yield BagMessage(
                        channel.topic,
                        self.topics[channel.topic].type,
                        message.log_time,
                        message.publish_time,
                        message.sequence,
                        message.data,
                    )

    def _survey(self, reader: McapReader) -> None:
        """Add topics, counts and embedded records of one file."""
        summary = reader.get_summary()
        if summary is None or summary.statistics is None:
            raise McapError("the file has no summary")
        for channel in summary.channels.values():
            self.topics[channel.topic] = topic_of(channel, summary.schemas[channel.schema_id])
        statistics = summary.statistics
        if statistics.message_count:
            self.start = min(self.start, statistics.message_start_time) if self else statistics.message_start_time
            self.end = max(self.end, statistics.message_end_time)
        for channel_id, count in statistics.channel_message_counts.items():
            self.counts[summary.channels[channel_id].topic] += count
        records = {record.name: record.metadata for record in reader.iter_metadata()}
        self.notes |= records.get(RECORDING_RECORD, {})
        if RUN_RECORD in records and self.run is None:
            files = {attachment.name: attachment.data for attachment in reader.iter_attachments()}
            self.run = RunInfo.from_bag(records[RUN_RECORD], files)


def require_topics(bag: Any, topics: Collection[str] | None) -> None:
    """Raise a RecordingError if ``bag``, an object with a path and topics, lacks one of the ``topics``."""
    if unknown := set(topics or ()) - set(bag.topics):
        raise RecordingError(f"bag {bag.path} has no topic {sorted(unknown)}; it has {sorted(bag.topics)}")


def topic_of(channel: Channel, schema: Schema) -> TopicInfo:
    """Return the topic that MCAP's channel and schema records describe; of several QoS profiles, use the first.

    Raises:
        ValueError: the definition of the type is too large, or the QoS profiles are no list of mappings.
        RecordingError: a policy of the QoS profile has an unknown name.
    """
    if len(schema.data) > _LARGEST_DEFINITION:
        text = (
            f"the definition of {schema.name[:80]} has {len(schema.data)} bytes; allowed: up to {_LARGEST_DEFINITION}"
        )
        raise ValueError(text)
    profiles = load_yaml(channel.metadata.get("offered_qos_profiles", "")) or []
    if not isinstance(profiles, list) or not all(isinstance(each, dict) for each in profiles):
        raise ValueError(f"the quality of service of {channel.topic[:80]} is no list of mappings")
    return TopicInfo(
        name=channel.topic,
        type=schema.name,
        qos=Qos.from_rosbag2(profiles[0]) if profiles else Qos(),
        definition=schema.data.decode(),
        type_hash=channel.metadata.get("topic_type_hash", ""),
        role=channel.metadata.get(ROLE_KEY, ""),
    )


def _bag_files(path: Path) -> list[Path]:
    if path.is_file():
        return [path]
    metadata = path / METADATA_FILE
    if metadata.is_file():
        try:
            return _list_files(metadata)
        except DAMAGE as error:
            cause = " ".join(str(error).split()) or repr(error)
            raise RecordingError(
                f"{metadata} is damaged: {cause}. Repair the bag: gdfe recover {quote_path(path)}"
            ) from error
    if any(path.glob("*.mcap")):
        raise RecordingError(
            f"bag {path} has no {METADATA_FILE}: its recording was cut off. Repair it: gdfe recover {quote_path(path)}"
        )
    for file in storage_files(path) if path.is_dir() else ():
        require_mcap(file)
    raise RecordingError(f"{path} is neither a bag directory nor an MCAP file")


def _list_files(metadata: Path) -> list[Path]:
    """Return the paths of the MCAP files that metadata.yaml lists.

    Raises:
        ValueError: a key or a file is missing.
        RecordingError: the files are not in MCAP format.
    """
    data = load_yaml(read_text(metadata, most=LARGEST_METADATA))
    info = data.get(ROOT_KEY) if isinstance(data, dict) else None
    if not isinstance(info, dict):
        raise ValueError(f"it has no {ROOT_KEY}")
    missing = [key for key in ("storage_identifier", "relative_file_paths") if not info.get(key)]
    if missing:
        raise ValueError(f"it has no {' and no '.join(missing)}")
    if info["storage_identifier"] != "mcap":
        remedy = "remedy: `gdfe fit` reads it; other commands need a bag that gdfe recorded, in MCAP"
        raise RecordingError(f"bag {metadata.parent} is stored as {info['storage_identifier']}; {remedy}")
    files = [metadata.parent / Path(name).name for name in info["relative_file_paths"]]
    absent = [file.name for file in files if not file.is_file()]
    if absent:
        raise ValueError(f"it names the file {', '.join(absent)}, which is not there")
    return files


@contextmanager
def _open(file: Path) -> Iterator[McapReader]:
    """Open one file for reading; replace errors of mcap and of the file by ``RecordingError``."""
    require_mcap(file)
    try:
        with file.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True)
            with mmap(stream.fileno(), 0, access=ACCESS_READ) as data:
                require_sound_summary(data)
                summary = reader.get_summary()
                chunks = summary.chunk_indexes if summary is not None else ()
                require_bounded(sum(chunk_size(data, each.chunk_start_offset) for each in chunks), len(data))
            yield reader
    except RecordingError as error:
        raise RecordingError(f"bag file {file}: {error}") from error
    except OSError as error:
        raise RecordingError(f"bag file {file} cannot be read: {error}") from error
    except DAMAGE as error:
        raise RecordingError(
            f"bag file {file} is damaged: {str(error) or repr(error)}. Repair it: gdfe recover {quote_path(file)}"
        ) from error

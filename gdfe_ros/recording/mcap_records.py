# SPDX-License-Identifier: Apache-2.0
"""Reading of the records of a truncated or damaged MCAP file. After damage, reading continues at an intact record."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from io import BytesIO
from mmap import mmap

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, McapRecord, Message, MessageIndex, Metadata, Schema
from mcap.stream_reader import breakup_chunk, get_chunk_data_stream
from zstandard import ZstdError

from gdfe_ros.recording.decoding import bound_libraries, limit_expansion, require_bounded

bound_libraries()
MAGIC = b"\x89MCAP0\r\n"
# Exceptions of mcap, lz4 (RuntimeError) and zstandard for invalid bytes.
DAMAGE = (
    McapError,
    ZstdError,
    struct.error,
    ValueError,
    RuntimeError,
    LookupError,
    TypeError,
    AttributeError,
    OverflowError,
    EOFError,
    MemoryError,
)
"""Exceptions that may occur while a damaged file is read, because any length, id or text in it may be wrong."""

_CHECKSUM = 4
_HEAD = struct.Struct("<BQ")
_SIZE = struct.Struct("<Q")
_FOOTER = struct.Struct("<BQQQI")
_KINDS = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.CHUNK: Chunk,
    Opcode.ATTACHMENT: Attachment,
    Opcode.METADATA: Metadata,
    Opcode.MESSAGE_INDEX: MessageIndex,
}
# Possible beginning of a chunk, an attachment or a metadata record: opcode, a length below 2^40, required bytes.
_BEGINNING = re.compile(
    rb"\x06(?=.{5}\0{3}.{28}(?:\0{4}|\x03\0{3}lz4|\x04\0{3}zstd).{5}\0{3})|[\x09\x0c](?=.{5}\0{3})", re.DOTALL
)


@dataclass
class Damage:
    """Damage of a file.

    Attributes:
        chunks: number of skipped chunks that did not match their checksum, or whose beginning is destroyed.
        records: number of other skipped records that cannot be read.
        cut: whether the file is truncated; valid once the last record has been read.
        expanded: declared size of the chunks so far [B].
    """

    chunks: int = 0
    records: int = 0
    cut: bool = True
    expanded: int = 0


def require_sound_summary(data: mmap) -> int:
    """Check the summary, with the index, at the end of a file; mcap's readers do not check its checksum.

    Returns:
        Offset of the summary [B]; 0 if the file has none.

    Raises:
        McapError: the file is truncated, or the summary is damaged.
    """
    size = len(data)
    place = size - len(MAGIC) - _FOOTER.size
    if place < 0 or data[size - len(MAGIC) :] != MAGIC:
        raise McapError("the file was cut off before its end")
    opcode, length, start, _, checksum = _FOOTER.unpack(data[place : place + _FOOTER.size])
    if opcode != Opcode.FOOTER or length != _FOOTER.size - _HEAD.size or not 0 <= start <= place:
        raise McapError("the end of the file is destroyed")
    if checksum and zlib.crc32(data[start or place : place + _FOOTER.size - _CHECKSUM]) != checksum:
        raise McapError("the index at the end of the file does not match its checksum")
    return start


def declarations(data: mmap) -> list[McapRecord]:
    """Return the schemas and channels that the file's summary repeats; empty if it is missing or damaged."""
    try:
        place, found = require_sound_summary(data), []
    except DAMAGE:
        return []
    while place and (end := _end(data, place)) is not None and data[place] != Opcode.FOOTER:
        if data[place] in (Opcode.SCHEMA, Opcode.CHANNEL):
            found.append(_record(data, place, end))
        place = end
    return found


def records(data: mmap, damage: Damage) -> Iterator[McapRecord]:
    """Yield the records of the data section, including those inside chunks, up to the end of the section or the file.

    After a record of implausible length, reading continues at the next intact chunk, attachment or metadata record.

    Args:
        data: contents of the file.
        damage: counts of the damage; this function updates them.

    Raises:
        RecordingError: the chunks expand too far.
    """
    place = len(MAGIC)
    while True:
        end = _end(data, place)
        if end is not None and data[place] == Opcode.DATA_END:
            damage.cut = data[len(data) - len(MAGIC) :] != MAGIC
            return
        found = None if end is None else _contents(data, place, end, damage)
        yield from found or ()
        following = end
        if end is None or not _is_plausible(data, end):
            following = _next_beginning(data, place + 1 if found is None else end, damage)
        if following is None:
            return
        if found is None:
            damage.chunks += data[place] == Opcode.CHUNK
            damage.records += data[place] != Opcode.CHUNK
        place = following


def chunk_size(data: mmap, place: int) -> int:
    """Return the declared size of the content of the chunk at offset ``place`` [B]."""
    return _SIZE.unpack_from(data, place + _HEAD.size + 16)[0]


def _end(data: mmap, place: int) -> int | None:
    """Return the end of the record at offset ``place``; None if there is no record, or if the file ends inside it."""
    if place + _HEAD.size > len(data):
        return None
    opcode, length = _HEAD.unpack(data[place : place + _HEAD.size])
    end = place + _HEAD.size + length
    known = Opcode.HEADER <= opcode < Opcode.DATA_END or (opcode == Opcode.DATA_END and length == _CHECKSUM)
    return end if known and end <= len(data) else None


def _is_plausible(data: mmap, place: int) -> bool:
    return place == len(data) or _end(data, place) is not None


def _next_beginning(data: mmap, place: int, damage: Damage) -> int | None:
    """Return the offset of the next intact chunk, attachment or metadata record from ``place`` on; None without one."""
    for match in _BEGINNING.finditer(data, place):
        end = _end(data, match.start())
        plausible = end is not None and _is_plausible(data, end)
        if plausible and _contents(data, match.start(), end, damage) is not None:
            return match.start()
    return None


def _contents(data: mmap, place: int, end: int, damage: Damage) -> list[McapRecord] | None:
    """Return the record between two offsets or, if it is a chunk, the records inside; None if they are damaged."""
    try:
        record = _record(data, place, end)
        if not isinstance(record, Chunk):
            return [record]
        if record.uncompressed_size > limit_expansion(len(record.data)):
            return None  # the number is damaged: no chunk may expand so far
        damage.expanded += record.uncompressed_size
        require_bounded(damage.expanded, len(data))
        return _split(record)
    except DAMAGE:
        return None


def _split(chunk: Chunk) -> list[McapRecord]:
    """Return the records of a chunk up to the first opcode of 0: mcap would take zeros for millions of records.

    Raises:
        McapError: the chunk begins with zeros, or a record is damaged.
    """
    stream, size = get_chunk_data_stream(chunk, validate_crc=True)
    content, at = stream.read(size), 0
    while at < size and content[at]:
        at += _HEAD.size + int.from_bytes(content[at + 1 : at + _HEAD.size], "little")
    if size and not at:
        raise McapError("the chunk begins with zeros, and no record has the opcode 0")
    return breakup_chunk(replace(chunk, compression="", data=content[:at]))


def _record(data: mmap, place: int, end: int) -> McapRecord:
    content = data[place + _HEAD.size : end]
    stream = ReadDataStream(BytesIO(content))
    if data[place] == Opcode.MESSAGE:
        return Message.read(stream, len(content))
    kind = _KINDS[data[place]]
    record = kind.read(stream)
    if stream.count != len(content):
        raise McapError(f"a record of {len(content)} B has content for {stream.count} B")
    if kind is Attachment:
        checksum = int.from_bytes(content[-_CHECKSUM:], "little")
        if checksum and checksum != zlib.crc32(content[:-_CHECKSUM]):
            raise McapError("an attachment does not match its checksum")
    return record

# SPDX-License-Identifier: Apache-2.0
"""Recording during a simulation: a bounded queue, and a thread that writes the bag."""

from __future__ import annotations

import atexit
import json
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import NamedTuple

from gdfe_ros.errors import RecordingError
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.recording.topic import TopicInfo
from gdfe_ros.recording.writer import BagOptions, BagWriter
from gdfe_ros.threads import RECORDER, show_name


class BackPressure(Enum):
    """Behaviour of ``Recorder.record`` while its queue is full because the disk is slower than the simulation.

    ``DROP`` rejects the message at once; it is for runs under the wall clock, which must not wait. ``BLOCK`` waits for
    space in the queue, at most for ``block_seconds``, and then rejects the message; it is for other runs, whose bags
    should be complete. ``RecorderStatus`` counts every rejected message.
    """

    DROP = "drop"
    BLOCK = "block"


@dataclass(frozen=True, kw_only=True)
class QueueOptions:
    """Options of the queue between simulation and writer.

    Args:
        max_bytes: largest size of the waiting messages [B], 1 MiB or more. An empty queue takes a message of any size.
        back_pressure: behaviour while the queue is full.
        block_seconds: longest wait under ``BLOCK`` [s], 0 or more.
        flush_seconds: interval at which all recorded data go to the operating system [s], 0.005 to 10. A killed process
            loses at most the messages of this interval and of the write in progress.

    Raises:
        ValueError: a value is out of range.
    """

    max_bytes: int = 64 << 20
    back_pressure: BackPressure = BackPressure.DROP
    block_seconds: float = 1.0
    flush_seconds: float = 0.04

    def __post_init__(self) -> None:
        if self.max_bytes < 1 << 20:
            raise ValueError(f"max_bytes is {self.max_bytes} B; allowed: {1 << 20} or more")
        if not self.block_seconds >= 0:
            raise ValueError(f"block_seconds is {self.block_seconds} s; allowed: 0 or more")
        if not 0.005 <= self.flush_seconds <= 10:
            raise ValueError(f"flush_seconds is {self.flush_seconds} s; allowed: 0.005 to 10")


# The thread wakes early when this many bytes [B] wait, so that a burst does not fill the queue.
_WAKE_BYTES = 1 << 20


@dataclass(frozen=True, kw_only=True)
class RecorderStatus:
    """Counts of a recording at one moment.

    Args:
        written: number of messages passed to the bag.
        waiting: number of messages in the queue.
        dropped: number of rejected or lost messages, by topic; they are not in the bag.
        error: why the recording stopped early, or None.
    """

    written: int
    waiting: int
    dropped: dict[str, int]
    error: RecordingError | None

    @property
    def dropped_total(self) -> int:
        """Number of messages that are not in the bag."""
        return sum(self.dropped.values())

    def summary(self, path: Path) -> str:
        """Return the counts and the error as a sentence about the bag at ``path``."""
        text = f"bag {path}: {self.written} messages, {self.dropped_total} dropped"
        return f"{text}; {self.error}; nothing later is in the bag" if self.error else text

    def to_notes(self) -> dict[str, str]:
        """Return the counts and the error as texts for the metadata of the bag."""
        return {
            "messages_written": str(self.written),
            "messages_dropped": str(self.dropped_total),
            "messages_dropped_by_topic": json.dumps(self.dropped, sort_keys=True),
            "error": str(self.error or ""),
        }


class _Message(NamedTuple):
    topic: str
    data: bytes
    log_time: int
    publish_time: int | None


class Recorder:
    """Records serialised messages in a thread; ``record`` takes microseconds and never raises because of the disk.

    If the disk is full or the device fails, the recording stops, and the simulation continues. ``error`` and ``status``
    state the reason, the bag is completed with its present contents, and ``failed`` is called. Until the bag is
    completed, messages that ``record`` rejects are counted in ``status`` and in the bag; after that, ``record`` only
    returns False. Without a call of ``close``, the bag is completed when the interpreter ends. A recorder can be used
    as a context manager.

    Args:
        path: directory of the bag; it must not exist yet, or be empty.
        topics: topics of the bag.
        run: origin of the run, embedded in every file; None: nothing is embedded.
        options: compression, splitting, fsync.
        queue: size limit, back-pressure and flush interval of the queue.
        failed: function that is called once in the thread, with the status, if the recording stopped early.

    Raises:
        RecordingError: the bag cannot be created.
    """

    def __init__(
        self,
        path: str | Path,
        topics: Iterable[TopicInfo] = (),
        *,
        run: RunInfo | None = None,
        options: BagOptions | None = None,
        queue: QueueOptions | None = None,
        failed: Callable[[RecorderStatus], None] = lambda status: None,
    ) -> None:
        self._writer = BagWriter(path, topics, run=run, options=options)
        self._topics = set(self._writer.topics)
        self._settings = queue or QueueOptions()
        self._state = threading.Condition()
        self._writing = threading.Lock()
        self._queue: deque[_Message] = deque()
        self._queued_bytes = 0
        self._written = 0
        self._dropped: Counter[str] = Counter()
        self._error: RecordingError | None = None
        self._failed = failed
        self._closing = self._ended = False
        self._wake = threading.Event()
        self._thread = threading.Thread(target=self._run, name=RECORDER, daemon=True)
        self._thread.start()
        atexit.register(self.close)

    @property
    def path(self) -> Path:
        """Directory of the bag."""
        return self._writer.path

    @property
    def error(self) -> RecordingError | None:
        """Why the recording stopped early, or None."""
        return self._error

    @property
    def status(self) -> RecorderStatus:
        """Counts at this moment."""
        with self._state:
            return RecorderStatus(
                written=self._written,
                waiting=len(self._queue),
                dropped=dict(self._dropped),
                error=self._error,
            )

    def add_topic(self, topic: TopicInfo) -> None:
        """Declare a further topic. It waits for a write in progress, so the stepping thread must not call it.

        Raises:
            RecordingError: as ``BagWriter.add_topic``.
        """
        with self._writing:
            self._writer.add_topic(topic)
        self._topics.add(topic.name)

    def record(self, topic: str, data: bytes, log_time: int, publish_time: int | None = None) -> bool:
        """Queue one message; callable from any thread.

        Args:
            topic: name of a declared topic.
            data: serialised message; ``bytes`` are stored without a copy.
            log_time: time since the epoch or since the start of the simulation [ns].
            publish_time: time of the publisher's stamp [ns]; None: ``log_time``.

        Returns:
            Whether the message was accepted. A rejected message is counted as dropped.

        Raises:
            RecordingError: the topic was not declared (a mistake in the program, not a fault of the disk).
        """
        if topic not in self._topics:
            raise RecordingError(f"topic {topic} is not in bag {self.path}; it has {sorted(self._topics)}")
        message = _Message(topic, data if type(data) is bytes else bytes(data), log_time, publish_time)
        with self._state:
            if not self._has_room(len(message.data)):
                self._dropped[topic] += not self._ended
                return False
            self._queue.append(message)
            self._queued_bytes += len(message.data)
            if self._queued_bytes > _WAKE_BYTES:
                self._wake.set()
        return True

    def close(self) -> RecorderStatus:
        """Write the queue, complete the bag and end the thread; a second call only returns the status.

        If the exception of a signal has interrupted the call, it can be repeated.
        """
        with self._state:
            self._closing = True
            self._state.notify_all()
        self._wake.set()
        self._thread.join()
        atexit.unregister(self.close)
        return self.status

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _has_room(self, size: int) -> bool:
        """Return whether the queue accepts a message of ``size`` [B]; under ``BLOCK`` wait for space.

        Needs the lock.
        """
        if self._settings.back_pressure is BackPressure.BLOCK and not self._fits(size):
            self._wake.set()
            self._state.wait_for(lambda: self._fits(size) or self._is_over(), timeout=self._settings.block_seconds)
        return self._fits(size) and not self._is_over()

    def _fits(self, size: int) -> bool:
        return not self._queue or self._queued_bytes + size <= self._settings.max_bytes

    def _is_over(self) -> bool:
        return self._closing or self._error is not None

    def _run(self) -> None:
        show_name()
        closing = False
        while not closing and self._error is None:
            self._wake.wait(self._settings.flush_seconds)
            self._wake.clear()
            closing = self._closing
            self._guarded(self._drain)
        with self._state:
            self._ended = True
        self._guarded(lambda: self._writer.close(self.status.to_notes()))
        if self._error is not None:
            self._failed(self.status)

    def _guarded(self, action: Callable[[], None]) -> None:
        """Run a part of the thread's work; an exception ends the recording, not the program."""
        try:
            with self._writing:
                action()
        except RecordingError as error:
            self._fail(error)
        except Exception as error:
            failure = RecordingError(f"recording {self.path} failed: {error!r}")
            failure.__cause__ = error
            self._fail(failure)

    def _fail(self, error: RecordingError) -> None:
        with self._state:
            self._error = self._error or error
            self._dropped.update(message.topic for message in self._queue)
            self._queue.clear()
            self._queued_bytes = 0
            self._state.notify_all()

    def _drain(self) -> None:
        """Write the queue, then flush it to the operating system."""
        written = self._written
        while self._queue:
            self._writer.write(*self._queue[0])
            with self._state:
                self._queued_bytes -= len(self._queue.popleft().data)
                self._written += 1
                self._state.notify_all()
        if self._written != written:
            self._writer.flush()

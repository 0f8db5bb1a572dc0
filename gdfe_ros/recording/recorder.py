# SPDX-License-Identifier: Apache-2.0
"""Recording during a simulation: a bounded queue, and a thread that writes the bag."""

from __future__ import annotations

import atexit
import json
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from gdfe_ros.errors import RecordingError
from gdfe_ros.recording.bag_info import TopicInfo
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.recording.writer import BagWriter
from gdfe_ros.threads import RECORDER, show_name

MOST_BYTES = 64 << 20
"""Largest size of the messages in the queue [B]. An empty queue takes a message of any size."""
LONGEST_WAIT = 30.0
"""Longest wait of ``Recorder.record`` for space in the queue, if the simulation waits for the disk [s]."""
FLUSH_INTERVAL = 0.04
"""Interval at which all recorded data go to the operating system [s]. A killed process loses at most the messages of
this interval and of the write in progress.
"""
# The thread wakes early when this many bytes [B] wait, so that a burst does not fill the queue.
_WAKE_BYTES = 1 << 20


@dataclass(frozen=True, kw_only=True)
class RecorderStatus:
    """Counts of a recording at one moment.

    Args:
        written: number of messages passed to the bag.
        dropped: number of rejected or lost messages, by topic; they are not in the bag.
        error: why the recording stopped early, or None.
    """

    written: int
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
        run: origin of the run, embedded in the file; None: nothing is embedded.
        waits: whether ``record`` waits while the queue is full, because the disk is slower than the simulation, and
            rejects the message only after `LONGEST_WAIT`. Otherwise it rejects the message at once, so that a run under
            the wall clock never waits.
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
        waits: bool = False,
        failed: Callable[[RecorderStatus], None] = lambda status: None,
    ) -> None:
        self._writer = BagWriter(path, topics, run=run)
        self._waits = waits
        self._state = threading.Condition()
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
            return RecorderStatus(written=self._written, dropped=dict(self._dropped), error=self._error)

    def record(self, topic: str, data: bytes, log_time: int) -> bool:
        """Queue one message; callable from any thread.

        Args:
            topic: name of a declared topic.
            data: serialised message; ``bytes`` are stored without a copy.
            log_time: time since the epoch or since the start of the simulation [ns].

        Returns:
            Whether the message was accepted. A rejected message is counted as dropped.

        Raises:
            RecordingError: the topic was not declared (a mistake in the program, not a fault of the disk).
        """
        self._writer.require_topic(topic)
        message = _Message(topic, data if type(data) is bytes else bytes(data), log_time)
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

        A call that the exception of a signal has interrupted can be repeated.
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
        """Return whether the queue accepts a message of ``size`` [B], after a wait for space. Needs the lock."""
        if self._waits and not self._fits(size):
            self._wake.set()
            self._state.wait_for(lambda: self._fits(size) or self._is_over(), timeout=LONGEST_WAIT)
        return self._fits(size) and not self._is_over()

    def _fits(self, size: int) -> bool:
        return not self._queue or self._queued_bytes + size <= MOST_BYTES

    def _is_over(self) -> bool:
        return self._closing or self._error is not None

    def _run(self) -> None:
        show_name()
        closing = False
        while not closing and self._error is None:
            self._wake.wait(FLUSH_INTERVAL)
            self._wake.clear()
            closing = self._closing
            self._guard(self._drain)
        with self._state:
            self._ended = True
        self._guard(lambda: self._writer.close(self.status.to_notes()))
        if self._error is not None:
            self._failed(self.status)

    def _guard(self, action: Callable[[], None]) -> None:
        """Run a part of the thread's work; an exception ends the recording, not the program."""
        try:
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

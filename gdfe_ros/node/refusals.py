# SPDX-License-Identifier: Apache-2.0
"""Refused commands: reasons, counts, warnings, checks of numbers, sizes and stamps; answers to requests."""

from __future__ import annotations

import math
import threading
from collections import Counter
from collections.abc import Callable, Collection
from concurrent.futures import Future
from enum import Enum, IntEnum
from typing import TYPE_CHECKING, Any

from gdfe_ros.errors import GdfeError
from gdfe_ros.untrusted.bounded_text import Throttle, plain_lines, shorten, without_middle

if TYPE_CHECKING:
    from builtin_interfaces.msg import Time

LONGEST = 400
"""Largest number of characters of a refusal in the log and on ~/refused."""
LARGEST_MESSAGE = 1_000_000
"""Largest number of bytes of a message that is read; rclpy needs a second for each megabyte."""


class Reason(Enum):
    """Reason of a refusal; the key of its count in /diagnostics."""

    MALFORMED = "malformed"
    NOT_FINITE = "not finite"
    NOT_UNIT = "quaternion not of unit length"
    TOO_FAR = "too far"
    TOO_FAST = "too fast"
    OUT_OF_RANGE = "out of range"
    WRONG_SIZE = "wrong size"
    FIXED = "handle is fixed"
    FOLLOWS = "handle follows"
    OVERLAP = "inside of something"
    UNKNOWN = "unknown name"
    INACTIVE = "node is not active"
    FRAME = "other frame"
    STALE = "stale"
    AHEAD = "stamp ahead"
    OUT_OF_ORDER = "out of order"
    QUEUE_FULL = "queue is full"


class Refusal(GdfeError):
    """A command was refused; it has no effect.

    Args:
        reason: reason under which the refusal is counted.
        text: the defect and the allowed values.
    """

    def __init__(self, reason: Reason, text: str) -> None:
        super().__init__(text)
        self.reason = reason


class RefusalLog:
    """Counts accepted and refused commands; warns at most once in five seconds for each input and reason.

    Args:
        warn: function that receives the text of a warning.
        tell: function that receives the arguments of each call of ``refuse``; None: not called.
        noun: noun for a refused item in the warnings.
    """

    def __init__(
        self,
        warn: Callable[[str], object],
        tell: Callable[[str, Refusal, bool], object] | None = None,
        *,
        noun: str = "command",
    ) -> None:
        self._warn, self._tell, self._noun, self._throttle = warn, tell, noun, Throttle()
        self._lock = threading.Lock()
        self._accepted = 0
        self._refused: Counter[Reason] = Counter()

    def accept(self) -> None:
        """Count an accepted command."""
        with self._lock:
            self._accepted += 1

    def refuse(self, source: str, refusal: Refusal, *, late: bool = False) -> None:
        """Count a refused command from ``source``, and warn if a warning is due.

        ``source`` is the full name of a topic, service or action. ``late``: the step refused it, not the arrival.
        """
        with self._lock:
            self._refused[refusal.reason] += 1
        if self._tell is not None:
            self._tell(source, refusal, late)
        if (more := self._throttle.due((source, refusal.reason))) is not None:
            self._warn(f"{self._noun} on {source} refused: {shorten(str(refusal), LONGEST)}{more}")

    def counts(self) -> dict[str, int]:
        """Return the counts for /diagnostics: commands accepted, refused, and refused for each reason so far."""
        with self._lock:
            by_reason = {f"refused: {reason.value}": count for reason, count in self._refused.items()}
            return {"commands taken": self._accepted, "commands refused": self._refused.total(), **by_reason}


def require_small(data: bytes) -> None:
    """Raise ``Refusal`` for a message of more than `LARGEST_MESSAGE` bytes."""
    if len(data) > LARGEST_MESSAGE:
        raise Refusal(Reason.WRONG_SIZE, f"the message has {len(data)} bytes; allowed: up to {LARGEST_MESSAGE}")


def require_finite(**vectors: tuple[float, ...]) -> None:
    """Raise a `Refusal` that shows all vectors by name if any number in them is not finite."""
    if not all(math.isfinite(value) for vector in vectors.values() for value in vector):
        given = " and ".join(f"{name} {vector}" for name, vector in vectors.items())
        raise Refusal(Reason.NOT_FINITE, f"{given} must be finite numbers")


def require_place(
    origin: Any, turn: Any, slack: float, names: tuple[str, str] = ("position", "orientation")
) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
    """Return the x, y, z [m] and the quaternion x, y, z, w of a message's place, after a check.

    Args:
        origin: part of the message with x, y, z.
        turn: part of the message with x, y, z, w.
        slack: largest allowed deviation of the quaternion's length from 1.
        names: names of the two parts, for messages.

    Raises:
        Refusal: a number is not finite, or the quaternion is not of unit length.
    """
    given = (origin.x, origin.y, origin.z), (turn.x, turn.y, turn.z, turn.w)
    require_finite(**dict(zip(names, given, strict=True)))
    length = math.hypot(*given[1])
    if abs(length - 1.0) > slack:
        text = f"{names[1]} (x, y, z, w) {given[1]} has length {length:.6g}; allowed: 1 +- {slack:g}"
        raise Refusal(Reason.NOT_UNIT, text)
    return given


class Freshness:
    """Checks the stamp of a command against the clock and against the last stamp for the same handle or actuator.

    A stamp of zero means "now" and is always accepted. If the clock goes back, as at the start of a replayed bag, the
    stored stamps are dropped.
    """

    def __init__(self) -> None:
        self._last: dict[str, int] = {}
        self._now = 0

    def check(self, sources: Collection[str], stamp: Time, *, now: int, max_age: float, max_lead: float) -> None:
        """Check a stamp and store it.

        Args:
            sources: topic and name of each commanded item; each has a last stamp of its own.
            stamp: stamp of the command.
            now: time on the clock of the stamps [ns].
            max_age: largest age of a command [s]; 0: no limit.
            max_lead: largest time by which a stamp may be ahead of ``now`` [s].

        Raises:
            Refusal: the stamp is ahead, too old, or before the last accepted one.
        """
        if now < self._now:
            self.reset()
        self._now = now
        moment = stamp.sec * 10**9 + stamp.nanosec
        if moment == 0:
            return
        age = (now - moment) * 1e-9
        if -age > max_lead:
            raise Refusal(
                Reason.AHEAD,
                f"its stamp {moment * 1e-9:.9f} s is {-age:.3f} s ahead of the node's clock, {now * 1e-9:.9f} s; "
                f"command_max_lead is {max_lead:g} s: do both use the same clock (use_sim_time)?",
            )
        if max_age and age > max_age:
            raise Refusal(
                Reason.STALE, f"its stamp {moment * 1e-9:.9f} s is {age:.3f} s old; command_max_age is {max_age:g} s"
            )
        last = max((self._last.get(source, moment) for source in sources), default=moment)
        if moment < last:
            raise Refusal(
                Reason.OUT_OF_ORDER,
                f"its stamp {moment * 1e-9:.9f} s is before the last one's, {last * 1e-9:.9f} s; "
                "a stamp of 0 is always accepted, and after ~/reset any stamp is",
            )
        self._last |= dict.fromkeys(sources, moment)

    def reset(self) -> None:
        """Drop the stored stamps, e.g. because time goes back to zero."""
        self._last.clear()


_LONGEST_REASON = 4000
"""Largest number of characters of a reason in an answer."""


class ResultCode(IntEnum):
    """Result codes of ``simulation_interfaces/msg/Result``; the message's own names differ between its versions.

    Codes above 100 belong to a single service.
    """

    UNSUPPORTED = 0
    OK = 1
    NOT_FOUND = 2
    INCORRECT_STATE = 3
    FAILED = 4
    ALREADY = 101
    NAME_NOT_UNIQUE = 101
    NAME_INVALID = 102
    UNSUPPORTED_FORMAT = 103
    NO_RESOURCE = 104
    NAMESPACE_INVALID = 105
    PARSE_ERROR = 106
    INVALID_POSE = 109
    SPAWN_FAILED = 150
    WORLD_FORMAT = 101
    WORLD_NO_RESOURCE = 102
    WORLD_PARSE_ERROR = 103
    NO_WORLD = 101
    SOURCES_FAILED = 101


class Refused(GdfeError):
    """A request that cannot be granted.

    Args:
        code: result code of the answer.
        text: reason and remedy.
    """

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text)
        self.code = code


def succeed(response: Any, text: str | None = None) -> Any:
    """Mark a response as successful, write the text into its ``message`` if it has this field, and return it."""
    if hasattr(response, "message"):
        response.success, response.message = True, text
    elif hasattr(response, "result"):
        response.result.result = int(ResultCode.OK)
    return response


def fail(response: Any, error: BaseException) -> Any:
    """Write the text and the code of an error into a response, as far as it has such fields, and return it.

    The code is that of a `Refused`, `ResultCode.INVALID_POSE` for a `Refusal`, and `ResultCode.FAILED` for any other
    error. ``error_message`` has its control characters escaped, because a null character, e.g. from the request, would
    end the text.
    """
    text = str(error) if isinstance(error, GdfeError) else repr(error)  # a KeyError's text is only its key
    if hasattr(response, "message"):
        response.success, response.message = False, text
    elif hasattr(getattr(response, "result", None), "error_message"):
        given = ResultCode.INVALID_POSE if isinstance(error, Refusal) else ResultCode.FAILED
        response.result.result = int(getattr(error, "code", given))
        response.result.error_message = plain_lines(without_middle(text, _LONGEST_REASON))
    return response


def answer_after(work: Future[Any], respond: Callable[[Future[Any]], Any]) -> Future[Any]:
    """Return a ``Future`` of the response that ``respond`` makes of ``work``, once ``work`` is done."""
    answer: Future = Future()
    work.add_done_callback(lambda done: answer.set_result(respond(done)))
    return answer


def answer(
    action: Callable[[Any, Any], Any], request: Any, response: Any, note: Callable[[BaseException], object]
) -> Any:
    """Return the response of a service, or a ``Future`` of it.

    Args:
        action: function that writes its results into the response, and returns a text or None, or raises `Refused` or
            another GdfeError. It may return a ``Future``; the result or exception of the ``Future`` becomes the answer.
        request: request of the service.
        response: empty response.
        note: function that receives an exception of the ``Future`` that is no GdfeError.
    """

    def respond(work: Future[Any]) -> Any:
        error = work.exception()
        if error is not None and not isinstance(error, GdfeError):
            note(error)
        return succeed(response, work.result()) if error is None else fail(response, error)

    try:
        work = action(request, response)
    except GdfeError as error:
        return fail(response, error)
    return answer_after(work, respond) if isinstance(work, Future) else succeed(response, work)

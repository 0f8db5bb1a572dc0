# SPDX-License-Identifier: Apache-2.0
"""Answers of the services of ``simulation_interfaces``: result codes and texts."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from enum import IntEnum
from typing import Any

from gdfe_ros.bounded_text import plain_lines
from gdfe_ros.errors import GdfeError
from gdfe_ros.node.plain_log import without_middle

_LONGEST = 4000
"""Largest number of characters of a reason in an answer."""


class ResultCode(IntEnum):
    """Result codes of ``simulation_interfaces/msg/Result``, whose names differ between its versions.

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


def done(response: Any) -> Any:
    """Return the response with the code of success; a response without a result, with nothing."""
    if hasattr(response, "result"):
        response.result.result = int(ResultCode.OK)
    return response


def failed(response: Any, code: int, text: str) -> Any:
    """Return the response with a code and the reason of a failure.

    The text may contain parts of the request. A null character in it would end it.
    """
    response.result.result, response.result.error_message = int(code), plain_lines(without_middle(text, _LONGEST))
    return response


def refused(response: Any, error: BaseException) -> Any:
    """Return the response with the text of an error, and the code of a `Refused`."""
    code = error.code if isinstance(error, Refused) else ResultCode.FAILED
    text = str(error) if isinstance(error, GdfeError) else repr(error)  # a KeyError's text is only its key
    return failed(response, code, text)


def answer_after(work: Future[Any], respond: Callable[[Future[Any]], Any]) -> Future[Any]:
    """Return a ``Future`` of the response that ``respond`` makes of ``work`` when this is done."""
    answer: Future = Future()
    work.add_done_callback(lambda done: answer.set_result(respond(done)))
    return answer


def answer_standard(action: Callable[[Any, Any], Future[Any] | None], request: Any, response: Any) -> Any:
    """Return the answer of a standard service, or a ``Future`` of it.

    Args:
        action: function that writes its results into the response, or raises `Refused` or another GdfeError. It may
            return a ``Future``: its exception, if any, becomes the answer.
        request: request of the service.
        response: empty response.
    """

    def respond(work: Future[Any]) -> Any:
        error = work.exception()
        return done(response) if error is None else refused(response, error)

    try:
        work = action(request, response)
    except GdfeError as error:
        return refused(response, error)
    return done(response) if work is None else answer_after(work, respond)

# SPDX-License-Identifier: Apache-2.0
"""Safe use of paths that come from data: only regular files of limited size are read, only inside of a folder.

A path in a scene, a request or a bag may lead to a pipe, which never answers, to a device, which never ends, or out of
the folder that is meant.
"""

from __future__ import annotations

import errno
import os
import re
import shlex
import stat
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

LARGEST = 2 << 30
"""Largest size of a file that is read whole [bytes]."""
NAME_PATTERN = "^[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}$"
"""Pattern of a name that becomes a part of paths and of the log."""
NAME_RULE = "1 to 64 letters, digits, _, - and .; the first is a letter, a digit or _"
_PART = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,127}\Z")
"""Pattern of a part of a path: a name, possibly with a suffix."""


def read_bytes(path: Path, *, most: int = LARGEST) -> bytes:
    """Return the content of a regular file.

    Raises:
        OSError: the file cannot be read, is no regular file, or has more than ``most`` bytes.
    """
    # Without O_NONBLOCK, opening a pipe waits until another process writes to it.
    number = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    with open(number, "rb") as file:
        _require_regular(os.fstat(number), path, most)
        return file.read()


def read_text(path: Path, *, most: int = LARGEST, encoding: str = "utf-8") -> str:
    """Return the content of a regular file as text, with each line end as a line feed.

    Raises:
        OSError: as for `read_bytes`.
        UnicodeDecodeError: the file is not text.
    """
    return read_bytes(path, most=most).decode(encoding).replace("\r\n", "\n").replace("\r", "\n")


def replace_file(path: Path, content: bytes) -> None:
    """Write a file, and its folder if that is missing; if writing fails or is killed, a former file stays whole.

    Raises:
        OSError: the file cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as written:
        written.write_bytes(content)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield another path in the folder of a file, to be written to; the file is replaced by it at the end.

    If writing fails or is killed, a former file stays whole. What is no regular file, e.g. a device, is written to
    itself.

    Raises:
        OSError: the file cannot be written; the error names it.
    """
    whole = path.resolve()
    if whole.exists() and not whole.is_file():
        yield path
        return
    written = whole.with_name(f".{os.getpid()}.{threading.get_native_id()}.{whole.name}")
    try:
        yield written
        os.replace(written, whole)
    except BaseException as error:
        written.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.filename in (None, str(written)):
            error.filename = str(path)
        raise


def require_regular(path: Path, *, most: int = LARGEST) -> None:
    """Check that a path leads to a regular file of at most ``most`` bytes, before another library reads it.

    Raises:
        OSError: there is no such file, or it is no regular file, or too large.
    """
    _require_regular(path.stat(), path, most)


def _require_regular(status: os.stat_result, path: Path, most: int) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise OSError(f"{path} is no regular file; allowed: no folder, pipe, socket or device")
    if status.st_size > most:
        raise OSError(f"{path} has {status.st_size} bytes; allowed: up to {most}")


def defect_of(path: Path) -> str:
    """Return why no file can have this path: a name is too long or has a null character. Empty for other paths."""
    try:
        os.lstat(path)
    except ValueError as error:
        return str(error)
    except OSError as error:
        return os.strerror(error.errno) if error.errno == errno.ENAMETOOLONG else ""
    return ""


def is_file(path: Path) -> bool:
    """Return whether a path leads to a file; False, without an error, for a path that no file can have."""
    return not defect_of(path) and path.is_file()


def quote_path(path: Path) -> str:
    """Return a path as an argument of a command that a user copies into a shell; it is never taken for an option."""
    return shlex.quote(f"./{path}" if str(path).startswith("-") else str(path))


def make_name(text: str) -> str:
    """Return a name that follows `NAME_PATTERN`: each other character of ``text`` becomes _, and the end is cut off."""
    return re.sub(r"^[.-]|[^A-Za-z0-9_.-]", "_", text)[:64] or "_"


def path_inside(folder: Path, name: str) -> Path:
    """Return the path of an entry of a folder; every path that is built from data is made by this function.

    Args:
        folder: the folder.
        name: name of the entry: a name that follows `NAME_PATTERN`, and possibly a suffix such as a date.

    Raises:
        ValueError: the name has another form, and could lead out of the folder.
    """
    if not _PART.match(name):
        raise ValueError(f"the name {name[:80]!r} cannot be a part of a path; allowed: {NAME_RULE}")
    return folder / name

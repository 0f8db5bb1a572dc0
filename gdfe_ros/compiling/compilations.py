# SPDX-License-Identifier: Apache-2.0
"""Count of the kernels that this process compiles, and file locks with which one process compiles for all.

This module imports no numba.
"""

from __future__ import annotations

import errno
import fcntl
import os
from contextlib import suppress

ONCE = "compiling kernels, once for this machine"


class Compilations:
    """Counter of the kernels that a process compiled.

    Attributes:
        compiled: number of kernels that are compiled.
        running: number of compilations in progress; a kernel's compilation includes those of the kernels that it calls.
    """

    def __init__(self) -> None:
        self.compiled, self.running = 0, 0

    def text(self) -> str | None:
        """Return a line about the compilation that is running, or None."""
        if not self.running:
            return None
        return f"{ONCE}: {self.compiled} of at least {self.compiled + self.running}"


compilations = Compilations()
"""The counter of this process."""


_WITHOUT = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS)
"""Numbers of the errors that file systems without locks raise."""


def lock_file(path: str) -> int:
    """Wait until no other process holds the lock of a file, take the lock, and return its descriptor.

    The file is made if it is missing. On a file system without locks nothing is waited for.
    """
    lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
    except BaseException as error:
        if not isinstance(error, OSError) or error.errno not in _WITHOUT:
            os.close(lock)
            raise
    return lock


def unlock_file(lock: int, path: str) -> None:
    """Remove the file of a lock and release the lock.

    A process that waited for the removed file, and one that makes a new file, may then hold a lock at the same time.
    Locks are therefore only for work that two processes may do, but need not.
    """
    with suppress(FileNotFoundError):
        os.unlink(path)
    os.close(lock)

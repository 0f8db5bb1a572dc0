# SPDX-License-Identifier: Apache-2.0
"""A file whose space is reserved ahead of its writes, so that a full disk never cuts a record in two."""

from __future__ import annotations

import errno
import os
from pathlib import Path

_STEP = 4 << 20
_CANNOT_RESERVE = (errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)


class ReservedFile:
    """Write-only, unbuffered file; ``reserve`` allocates before ``write`` needs it.

    A full disk, a quota or a file-size limit then shows as an ``OSError`` of ``reserve``, at a moment when
    nothing is half written and what was promised before can still be written: the file can be ended properly.
    Where the system or the file system cannot reserve (macOS, some network mounts), such an error comes from
    ``write`` instead. While open, the file may be up to 4 MiB longer than what was written, filled with
    zeros; ``close`` cuts it to length.

    Args:
        path: of the file, which must not exist.

    Raises:
        OSError: the file exists or cannot be created.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._position = 0
        self._allocated = 0
        self._fd: int | None = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)

    def reserve(self, size: int) -> None:
        """Make sure that the next ``size`` bytes [B] can be written.

        Raises:
            OSError: they cannot (ENOSPC, EDQUOT, EFBIG, ...). Earlier reservations still hold.
        """
        end = self._position + size
        if end <= self._allocated:
            return
        generous = max(end, self._allocated + _STEP)
        try:
            self._allocate(generous)
        except OSError:
            self._allocate(end)

    def _allocate(self, end: int) -> None:
        if hasattr(os, "posix_fallocate"):
            try:
                os.posix_fallocate(self._descriptor(), self._allocated, end - self._allocated)
            except OSError as error:
                if error.errno not in _CANNOT_RESERVE:
                    raise
        self._allocated = end

    def write(self, data: bytes) -> int:
        """Append bytes; all of them or an ``OSError``."""
        view = memoryview(data)
        while view:
            count = os.write(self._descriptor(), view)
            self._position += count
            view = view[count:]
        return len(data)

    def tell(self) -> int:
        """Bytes written so far [B]."""
        return self._position

    def flush(self) -> None:
        """Do nothing: writes go straight to the operating system."""

    def sync(self) -> None:
        """Wait until what was written is on the device."""
        os.fsync(self._descriptor())

    def close(self, *, sync: bool = False) -> None:
        """Cut the reservation off and close; a second call does nothing.

        Args:
            sync: also wait until the file is on the device.
        """
        if self._fd is None:
            return
        fd, self._fd = self._fd, None
        try:
            os.ftruncate(fd, self._position)
            if sync:
                os.fsync(fd)
        finally:
            os.close(fd)

    def _descriptor(self) -> int:
        if self._fd is None:
            raise ValueError(f"{self.path} is closed")
        return self._fd

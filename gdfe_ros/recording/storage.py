# SPDX-License-Identifier: Apache-2.0
"""A file whose space is reserved before each write, so that a full disk never truncates a record."""

from __future__ import annotations

import errno
import os
from pathlib import Path

_STEP = 4 << 20
_CANNOT_RESERVE = (errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)


class ReservedFile:
    """Write-only, unbuffered file; ``reserve`` allocates space before ``write`` needs it.

    A full disk, a quota or a file-size limit then causes an ``OSError`` of ``reserve``. At that moment no record is
    half written, and earlier reservations stay valid, so that the file can be finished properly. On systems or file
    systems without reservation (macOS, some network mounts), ``write`` raises such an error instead. While open, the
    file may be up to 4 MiB longer than the written data, filled with zeros; ``close`` truncates it.

    Args:
        path: path of the file, which must not exist.

    Raises:
        OSError: the file exists or cannot be created.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._position = 0
        self._allocated = 0
        self._fd: int | None = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)

    def reserve(self, size: int) -> None:
        """Ensure that the next ``size`` bytes [B] can be written.

        Raises:
            OSError: there is no space (ENOSPC, EDQUOT, EFBIG, ...). Earlier reservations stay valid.
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
        """Append all bytes and return their number; raise ``OSError`` if they cannot be written."""
        view = memoryview(data)
        while view:
            count = os.write(self._descriptor(), view)
            self._position += count
            view = view[count:]
        return len(data)

    def tell(self) -> int:
        """Return the number of bytes written so far [B]."""
        return self._position

    def flush(self) -> None:
        """Do nothing: writes go straight to the operating system."""

    def sync(self) -> None:
        """Wait until the written data are on the device."""
        os.fsync(self._descriptor())

    def close(self, *, sync: bool = False) -> None:
        """Truncate the file to the written data and close it; a second call does nothing.

        Args:
            sync: whether to wait until the file is on the device.
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

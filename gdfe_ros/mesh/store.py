# SPDX-License-Identifier: Apache-2.0
"""Disk cache of computed meshes; the key is a digest of the content from which a mesh is computed.

A file is first written under a temporary name and then renamed, so that concurrent processes never read an incomplete
file. It starts with the digest of its content. If a power cut or a full disk has truncated the file, the mesh is
computed again. The key also depends on the sources of `gdfe_ros.mesh`, numpy's version and the machine's architecture,
so that other versions never read the file.
"""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Mapping
from contextlib import suppress
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from tempfile import NamedTemporaryFile

import numpy as np
from numpy.typing import NDArray

MOST_BYTES = 256_000_000
"""Limit of the total size of the cached files [B]; the least recently used files are deleted first."""
_DIGEST = 32


def key_of(*parts: bytes) -> str:
    """Return the cache key of a result that is computed from these contents, a SHA-256 digest in hexadecimal."""
    digest = hashlib.sha256(_code())
    for part in parts:
        digest.update(len(part).to_bytes(8, "little") + part)
    return digest.hexdigest()


def recall(key: str) -> dict[str, NDArray] | None:
    """Return the arrays stored under a key; None if there are none, or if the file is damaged."""
    path = _folder() / f"{key}.npz"
    try:
        content = path.read_bytes()
        if hashlib.sha256(content[_DIGEST:]).digest() != content[:_DIGEST]:
            return None
        os.utime(path)
        archive = np.load(BytesIO(content[_DIGEST:]), allow_pickle=False)
    except OSError:
        return None
    return {name: archive[name] for name in archive.files}


def keep(key: str, arrays: Mapping[str, NDArray]) -> None:
    """Store arrays under a key. If the disk is full or read-only, nothing is stored, and no error is raised."""
    buffer = BytesIO()
    np.savez(buffer, **arrays)
    content, folder = buffer.getvalue(), _folder()
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        with NamedTemporaryFile(dir=folder, suffix=".part", delete=False) as file:
            try:
                file.write(hashlib.sha256(content).digest() + content)
                file.close()
                os.replace(file.name, folder / f"{key}.npz")
            except OSError:
                Path(file.name).unlink(missing_ok=True)
                raise
        _tidy(folder)


def _tidy(folder: Path) -> None:
    """Delete the files used least recently until the total size is at most `MOST_BYTES`."""
    files = sorted(((item.stat().st_mtime, item.stat().st_size, item) for item in folder.iterdir()), reverse=True)
    total = 0
    for _, size, path in files:
        total += size
        if total > MOST_BYTES:
            path.unlink(missing_ok=True)


def _folder() -> Path:
    """Return the folder of the cached files, beside numba's cache of compiled kernels."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        return Path(chosen) / "gdfe_ros_bodies"
    beside = Path(__file__).parent
    if os.access(beside, os.W_OK):
        return beside / "__pycache__" / "bodies"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gdfe_ros" / "bodies"


@lru_cache(maxsize=1)
def _code() -> bytes:
    """Return a digest of the sources of `gdfe_ros.mesh`, of numpy's version and of the machine's architecture."""
    digest = hashlib.sha256(f"{np.__version__} {platform.machine()}".encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.digest()

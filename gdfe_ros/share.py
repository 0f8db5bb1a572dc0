# SPDX-License-Identifier: Apache-2.0
"""Where the files beside the code (scenes, launch files, parameters) are."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from gdfe_ros.errors import GdfeError

_PACKAGE = "gdfe_ros"


@lru_cache(maxsize=1)
def share_dir() -> Path:
    """Find the directory that holds ``package.xml``, ``config/`` and ``launch/``.

    The answer depends only on where this module lies, so that code and scenes are always of one version:
    the source tree for a clone, ``pip install -e`` and ``colcon build --symlink-install``, otherwise
    ``<prefix>/share/gdfe_ros`` of the prefix that the package was installed into (colcon, apt, pip, venv).

    Returns:
        Absolute path of the directory.

    Raises:
        GdfeError: the package was copied without its share files.
    """
    module = Path(__file__).resolve()
    prefixes = module.parents[1:]
    for directory in (prefixes[0], *(prefix / "share" / _PACKAGE for prefix in prefixes)):
        if (directory / "package.xml").is_file():
            return directory
    raise GdfeError(
        f"the share directory of {_PACKAGE} was not found: no share/{_PACKAGE}/package.xml in any directory "
        f"above {module}. Install the package with `make install`, `pip install .` or `colcon build`."
    )

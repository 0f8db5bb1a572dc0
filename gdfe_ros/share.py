# SPDX-License-Identifier: Apache-2.0
"""Location of the package's files that are not code: scenes, launch files, parameters."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from gdfe_ros.errors import GdfeError

_PACKAGE = "gdfe_ros"


@lru_cache(maxsize=1)
def share_dir() -> Path:
    """Return the directory that contains ``package.xml``, ``config/`` and ``launch/``.

    It depends only on the location of this module, so that code and scenes always have the same version. For a clone,
    ``pip install -e`` and ``colcon build --symlink-install``, the directory is the source tree. Otherwise it is
    ``<prefix>/share/gdfe_ros``, with the prefix of the installation (colcon, apt, pip, venv).

    Returns:
        Absolute path of the directory.

    Raises:
        GdfeError: the package was copied without the files of its share directory.
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

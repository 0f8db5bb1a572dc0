# SPDX-License-Identifier: Apache-2.0
"""Paths in a scene file, relative to the folder of that file, or inside of an installed package of Python."""

from __future__ import annotations

import re
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, ValidationInfo

from gdfe_ros.installation import robots_extra
from gdfe_ros.untrusted.regular_file import defect_of

INSTALLED = "pip://"
"""Prefix of the path of a file in an installed package: ``pip://<package>/<path in the package's RECORD>``."""
_PACKAGE = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")


def resolve_path(value: Any, info: ValidationInfo) -> Path:
    """Return a path of the scene file as an absolute path; the file need not exist.

    Args:
        value: the value in the file.
        info: pydantic's information; its `context` has the `folder` of the scene file, None for a scene given as text.

    Raises:
        ValueError: the value is not text, is relative although there is no folder, names a package that is not
            installed, or cannot be the path of a file.
    """
    folder = (info.context or {}).get("folder")
    if not isinstance(value, str):
        raise ValueError("allowed is the path of a file, relative to the folder of the scene")
    if value.startswith(INSTALLED):
        path = _locate(*value.removeprefix(INSTALLED).partition("/")[::2])
    elif folder is None and not Path(value).is_absolute():
        raise ValueError("a scene given as text has no folder: give a full path")
    else:
        path = Path(folder or "/") / value
    if defect := defect_of(path):
        raise ValueError(f"no file can have this path: {defect}")
    return path


def _locate(package: str, path: str) -> Path:
    """Return the path of a file of an installed package."""
    if not _PACKAGE.fullmatch(package):  # its name is a part of a command that the user may paste
        allowed = "allowed: the name of a Python package, and / with the path of its file"
        raise ValueError(f"'pip://' is followed by {package[:80]!r}; {allowed}")
    try:
        return Path(distribution(package).locate_file(path))
    except (PackageNotFoundError, ValueError) as error:
        extra = robots_extra(package)
        own = f"pip install {package}, if you know and trust this package"
        remedy = own if extra is None else f"pip install 'gdfe_ros[{extra}]'"
        raise ValueError(f"the package '{package}' is not installed; remedy: {remedy}") from error


def missing_packages(text: str) -> list[str]:
    """Return the packages that ``pip://`` paths in a scene's text name and that are not installed."""
    return [name for name in sorted(set(re.findall(rf"{INSTALLED}([\w.-]+)/", text))) if not _is_installed(name)]


def _is_installed(package: str) -> bool:
    try:
        distribution(package)
    except PackageNotFoundError:
        return False
    return True


FilePath = Annotated[Path, BeforeValidator(resolve_path)]

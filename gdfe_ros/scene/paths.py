# SPDX-License-Identifier: Apache-2.0
"""Paths in a scene file, relative to the folder of that file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, ValidationInfo
from pydantic_core import PydanticCustomError


def resolve_path(value: Any, info: ValidationInfo) -> Path:
    """Return a path of the scene file as an absolute path; the file need not exist.

    Args:
        value: the value in the file.
        info: pydantic's information; its `context` has the `folder` of the scene file, None for a scene given as text.

    Raises:
        PydanticCustomError: the value is no text, or it is a relative path and there is no folder.
    """
    folder = (info.context or {}).get("folder")
    if not isinstance(value, str):
        raise PydanticCustomError("path", "allowed is the path of a file, relative to the folder of the scene")
    if folder is None and not Path(value).is_absolute():
        raise PydanticCustomError("path", "a scene given as text has no folder: give a full path")
    return Path(folder or "/") / value


FilePath = Annotated[Path, BeforeValidator(resolve_path)]

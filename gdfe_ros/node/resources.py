# SPDX-License-Identifier: Apache-2.0
"""Files that requests of ``simulation_interfaces`` name by URI, and lists of such files."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import islice
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse

from gdfe_ros.node.interface import services
from gdfe_ros.node.managed import ManagedNode
from gdfe_ros.node.standard_answers import Refused, done
from gdfe_ros.node.standard_offer import offer
from gdfe_ros.regular_file import read_text
from gdfe_ros.scene.entity import LARGEST
from gdfe_ros.share import share_dir

SPAWNED = (".urdf", ".yaml", ".yml")
"""Suffixes of files that describe a body."""
WORLDS = (".yaml", ".yml")
"""Suffixes of files that describe a scene."""
_MOST_FILES, _MOST_SOURCES = 1000, 20
"""Largest number of files that are listed of one folder, and of folders in a request."""


def path_of(uri: str, suffixes: Collection[str], *, code: int) -> Path:
    """Return the path of a URI ``file:///path``, or of a path.

    Raises:
        Refused: it is neither, or has another suffix; its code is ``code``.
    """
    scheme, path = _parts(uri)
    if scheme not in ("", "file") or path.suffix.lower() not in suffixes:
        raise Refused(code, f"uri is {uri[:200]!r}; allowed: file:///path or a path, to a file {', '.join(suffixes)}")
    return path


def files_in(sources: Sequence[str], suffixes: Collection[str]) -> tuple[list[Path], str]:
    """Return the files of some folders, without their subfolders, and a text on the sources that cannot be listed."""
    found: list[Path] = []
    wrong = [f"{len(sources) - _MOST_SOURCES} more than {_MOST_SOURCES}"] if len(sources) > _MOST_SOURCES else []
    for source in sources[:_MOST_SOURCES]:
        folder = _parts(source)[1]
        try:
            each = (path for path in folder.iterdir() if path.suffix.lower() in suffixes and path.is_file())
            found += sorted(islice(each, _MOST_FILES))
        except (OSError, ValueError) as error:  # no folder, not readable, or no path
            wrong.append(f"{source[:200]!r} ({getattr(error, 'strerror', None) or error})")
    return found, f"sources that cannot be listed: {', '.join(wrong)}" if wrong else ""


def _parts(uri: str) -> tuple[str, Path]:
    """Return scheme and path of a URI; the scheme is not "file" if the text is no URI."""
    try:
        parts = urlparse(uri)
    except ValueError:  # e.g. a bracket that is not closed
        return "no URI", Path(uri)
    return parts.scheme, Path(unquote(parts.path))


def offer_spawnables(node: ManagedNode) -> None:
    """Offer the service that lists the bodies that can be spawned by URI."""
    offer(node, {services.GET_SPAWNABLES: _list_spawnables})


def _list_spawnables(request: Any, response: Any) -> Any:
    import simulation_interfaces.msg

    own = sorted((share_dir() / "config" / "bodies").glob("*.yaml"))
    others, wrong = files_in(request.sources, SPAWNED)
    for path in (*own, *others):
        text = read_text(path, most=LARGEST).partition("\n")[0].lstrip("# ") if path in own else ""
        uri = path.absolute().as_uri()
        response.spawnables.append(simulation_interfaces.msg.Spawnable(uri=uri, description=text))
    response.result.error_message = wrong
    return done(response)

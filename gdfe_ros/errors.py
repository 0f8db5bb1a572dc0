# SPDX-License-Identifier: Apache-2.0
"""Errors that users see: each names the item, its place, the value, the allowed range and the remedy."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence


class GdfeError(Exception):
    """Base of every error that this package raises on purpose."""


def show_point(place: Iterable[float]) -> str:
    """Return a point as text for a message, with four digits, e.g. ``(0.1, 0.02, 0)``."""
    return f"({', '.join(f'{value:.4g}' for value in place)})"


ENDED = "the derivatives were ended before they were found"
"""Error message after the computation of derivatives was interrupted."""


_LONGEST_DEFECT, _MOST_DEFECTS = 2000, 100
"""The text of an error shows at most this number of characters of a defect, and at most this number of defects."""


class DefectsError(GdfeError):
    """An input with one or more defects; the error lists all of them.

    Args:
        heading: name of the input, e.g. ``scene config/scenes/bar.yaml``.
        defects: one line of text for each defect; the error's text shows at most the first hundred.
    """

    def __init__(self, heading: str, defects: Sequence[str]) -> None:
        self.heading = heading
        self.defects = list(defects)
        count = f"{len(self.defects)} defect" + ("s" if len(self.defects) != 1 else "")
        shown = [f"{each[:_LONGEST_DEFECT]}..." if len(each) > _LONGEST_DEFECT else each for each in self.defects]
        if len(shown) > _MOST_DEFECTS:
            shown[_MOST_DEFECTS:] = [f"and {len(shown) - _MOST_DEFECTS} more"]
        super().__init__("\n  - ".join([f"{heading}: {count}", *shown]))

    def __reduce__(self) -> tuple[type[DefectsError], tuple[str, list[str]]]:
        """Return the arguments for pickling, with which the error is passed from a worker process to its caller."""
        return type(self), (self.heading, self.defects)


class MeshError(DefectsError):
    """A mesh that cannot be simulated."""


class SceneError(DefectsError):
    """A scene file that cannot be read or is inconsistent."""


class ArmError(DefectsError):
    """An arm's description that cannot be used."""


class CommandError(GdfeError):
    """A command that cannot be carried out; the state is unchanged."""


def require_named(noun: str, name: str, known: Collection[str], of: str = "") -> None:
    """Check the name of an item; ``of``, e.g. `` in scene 'bend5'``, tells where the ``known`` items are.

    Raises:
        CommandError: the name is not among the known ones; the error lists them.
    """
    if name not in known:
        raise CommandError(f"no {noun} {name!r}{of}; {noun}s: {', '.join(known) or 'none'}")


class RangeError(CommandError):
    """A command is a number out of its range."""


class OverlapError(CommandError):
    """A free body would be inside another object; the teleport or reset that would cause it is not made."""


class DependencyError(ImportError):
    """A package that is missing or too old."""


class RecordingError(GdfeError):
    """A bag that cannot be written, read or recovered."""

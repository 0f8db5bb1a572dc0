# SPDX-License-Identifier: Apache-2.0
"""Checks of mesh files before reading, time limits, units of length, and meshers in a separate process."""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import MeshError
from gdfe_ros.untrusted.regular_file import defect_of, require_regular

LARGEST = 500_000_000
"""Largest size of a mesh file [bytes]."""


def require_file(path: Path, heading: str, *, suffixes: Collection[str] = ()) -> None:
    """Check that a path is a readable file of an allowed size and kind.

    Raises:
        MeshError: the file does not exist, is a folder, pipe or device, is too large, or has none of the ``suffixes``
            (if any are given); ``heading`` names the file in the error.
    """
    if defect := defect_of(path):
        raise MeshError(heading, [f"no file can have this path: {defect}"])
    if path.is_dir():
        raise MeshError(heading, ["this is a folder; remedy: the path of a file in it"])
    if not path.exists():
        raise MeshError(heading, ["there is no such file; paths in a scene are relative to the folder of the scene"])
    try:
        require_regular(path, most=LARGEST)
    except OSError as error:
        raise MeshError(heading, [f"{error}; remedy: the path of a mesh file"]) from error
    if suffixes and path.suffix.lower() not in suffixes:
        raise MeshError(heading, [f"unknown kind of file {path.suffix!r}; allowed: {', '.join(suffixes)}"])


LEAST, EACH_MEGABYTE = 5.0, 5.0
"""Time limit for reading a file [s], and further time for each megabyte of the file [s]."""


@contextmanager
def limit_time(path: Path) -> Iterator[None]:
    """Interrupt a ``with`` block that reads a file, at the next function call after its time limit.

    Raises:
        TimeoutError: the block takes longer than `LEAST` plus `EACH_MEGABYTE` for each megabyte of the file.
    """
    most = LEAST + EACH_MEGABYTE * 1e-6 * path.stat().st_size
    end, before = time.monotonic() + most, sys.getprofile()

    def check(frame: FrameType, event: str, argument: object) -> None:
        if time.monotonic() > end:
            raise TimeoutError(f"it takes more than {most:.3g} s")

    sys.setprofile(check)
    try:
        yield
    finally:
        sys.setprofile(before)


#: Diagonal [m] above which a soft body counts as given in another unit, unless the scene states a scale.
LONGEST = 3.0
#: Diagonal [m] below which a soft body counts as given in another unit, unless the scene states a scale.
SHORTEST = 1e-4
#: Usual units of mesh files and their size in metres.
UNITS: Mapping[str, float] = {"m": 1.0, "cm": 0.01, "inch": 0.0254, "mm": 0.001, "um": 1e-6}


def guess_unit(size: float) -> str:
    """Guess the unit of a file (m, mm or um): the one in which the body's size is closest to a hand, 0.1 m.

    Args:
        size: bounding-box diagonal in the file's own unit, > 0.
    """
    return min(("m", "mm", "um"), key=lambda unit: abs(math.log10(size * UNITS[unit] / 0.1)))


def unit_defects(size: float, scale: float | None) -> list[str]:
    """Return a list with one defect if no scale was stated and the size in metres is implausible; empty otherwise.

    Args:
        size: bounding-box diagonal in the file's own unit.
        scale: metres for each unit of the file as stated by the user; None if not stated.
    """
    if scale is not None or not math.isfinite(size) or size == 0.0 or SHORTEST <= size <= LONGEST:
        return []
    unit = guess_unit(size)
    plausible = unit != "m" and SHORTEST <= size * UNITS[unit] <= LONGEST
    advice = f"it seems to be in {unit}: give `scale: {UNITS[unit]:g}`" if plausible else "check its unit"
    return [
        f"the body's diagonal is {size:g}, which is not in metres for a soft robot (allowed without `scale`: "
        f"{SHORTEST:g} to {LONGEST:g} m); remedy: {advice}, or `scale: 1.0` if it is in metres"
    ]


LONGEST_RUN = 1800.0
"""Time [s] after which a mesher is stopped."""
_MESHERS = ("step", "surface")
_SCRIPT = Path(__file__).with_name("mesher_process.py")


def run_mesher(
    kind: str, request: dict, heading: str, *, longest: float = LONGEST_RUN, noun: str = "mesher"
) -> dict[str, NDArray]:
    """Run a task of `mesher_process` in a separate process; return the arrays of its result.

    Args:
        kind: name of the task, a key of ``_TASKS`` in `mesher_process`.
        request: dict of the task's arguments.
        heading: name of the file in an error.
        longest: time limit [s].
        noun: name of the process in an error.

    Raises:
        MeshError: the task fails, takes longer than ``longest``, or needs a package that is not installed.
    """
    began = time.monotonic()
    if kind in _MESHERS:
        print(f"{heading}: meshing", end=" ", file=sys.stderr, flush=True)
    with tempfile.TemporaryDirectory() as folder:
        asked, answer = Path(folder) / "request.npz", Path(folder) / "result.npz"
        np.savez(asked, **request)
        command = [sys.executable, str(_SCRIPT), kind, str(asked), str(answer)]
        try:
            # Meshers write files into their working directory.
            options = {"cwd": folder, "capture_output": True, "text": True, "errors": "replace", "timeout": longest}
            done = subprocess.run(command, **options, check=False)
        except subprocess.TimeoutExpired as error:
            text = f"the {noun} did not end in {longest:g} s; remedy: a larger size, or a simpler file"
            raise MeshError(heading, [text]) from error
        if not answer.is_file():
            said = " ".join((done.stderr or done.stdout).split())[-300:]
            text = f"the {noun} ended with code {done.returncode}: {said or 'no message'}"
            raise MeshError(heading, [f"{text}; remedy: repair the file, see `gdfe inspect`"])
        with np.load(answer, allow_pickle=False) as archive:
            found = dict(archive)
    if "missing" in found:
        raise MeshError(heading, [f"{found['missing']} is not installed; remedy: pip install 'gdfe_ros[cad]'"])
    if "defect" in found:
        raise MeshError(heading, [str(found["defect"])])
    if kind not in _MESHERS:
        return found
    print(f"took {time.monotonic() - began:.1f} s, {len(found['cells'])} tetrahedra", file=sys.stderr)
    return found

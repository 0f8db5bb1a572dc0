# SPDX-License-Identifier: Apache-2.0
"""Run of a mesher in a separate process."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import MeshError

LONGEST_RUN = 1800.0
"""Time [s] after which a mesher is stopped."""
_MESHERS = ("step", "surface")
_SCRIPT = Path(__file__).with_name("mesher_process.py")


def run_mesher(
    kind: str, request: dict, heading: str, *, longest: float = LONGEST_RUN, noun: str = "mesher"
) -> dict[str, NDArray]:
    """Run a task of `mesher_process` in a separate process; return the arrays of its result.

    Args:
        kind: the task.
        request: arrays for it.
        heading: name of the file in an error.
        longest: time [s] after which it is stopped.
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

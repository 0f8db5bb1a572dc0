# SPDX-License-Identifier: Apache-2.0
"""Runs of CalculiX (``ccx``), and readers of its output files: displacements (``.frd``) and reactions (``.dat``)."""

from __future__ import annotations

import resource
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np
import numpy.typing as npt

from benchmarks.peers.peer import PeerError

Nodal = dict[int, tuple[float, float, float]]
"""Dict from node number to three components."""


@dataclass(frozen=True, kw_only=True)
class CcxRun:
    """A run of ``ccx``: its log, the texts of its output files, its wall time and its processor time [s]."""

    log: str
    frd: str
    dat: str
    wall: float
    processor: float


def available() -> str | None:
    """Return None if ``ccx`` is on the path, else a text that says how to install it."""
    return None if shutil.which("ccx") else "no program ccx; install it with: apt-get install calculix-ccx"


def run_ccx(deck: str, where: str, *, timeout: float | None = None) -> CcxRun:
    """Run ``ccx`` on the text of a deck.

    Args:
        deck: input deck.
        where: words about the run for errors.
        timeout: longest wall time [s].

    Raises:
        PeerError: ``ccx`` fails, with the end of its log, or takes too long.
    """
    with tempfile.TemporaryDirectory(prefix="gdfe_ccx_") as folder:
        job = Path(folder, "job")
        job.with_suffix(".inp").write_text(deck)
        before, started = _children_time(), perf_counter()
        try:
            done = subprocess.run(
                ["ccx", job.name], cwd=folder, capture_output=True, text=True, check=False, timeout=timeout
            )
        except subprocess.TimeoutExpired:
            raise PeerError(f"calculix {where}: not done within {timeout:g} s") from None
        wall, processor = perf_counter() - started, _children_time() - before
        if done.returncode != 0 or "*ERROR" in done.stdout:
            tail = "\n".join(done.stdout.strip().splitlines()[-6:])
            raise PeerError(f"calculix {where}: ccx ended with status {done.returncode}:\n{tail}")
        frd, dat = (job.with_suffix(suffix) for suffix in (".frd", ".dat"))
        texts = {name: path.read_text() if path.is_file() else "" for name, path in (("frd", frd), ("dat", dat))}
    return CcxRun(log=done.stdout, wall=wall, processor=processor, **texts)


def _children_time() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def read_displacements(text: str) -> Nodal:
    """Return the displacements of the last ``DISP`` block of an ASCII ``.frd`` file.

    The format has fixed widths: key ``-1``, node number in 10 columns, then 12 columns per component.

    Raises:
        ValueError: if there is no such block, or a line of it cannot be read.
    """
    blocks = text.split(" -4  DISP")
    if len(blocks) < 2:
        raise ValueError("the .frd file holds no block DISP: did the analysis end early?")
    found: Nodal = {}
    for line in blocks[-1].splitlines()[1:]:
        if line.startswith(" -3"):
            return found
        if line.startswith(" -1"):
            found[int(line[3:13])] = (float(line[13:25]), float(line[25:37]), float(line[37:49]))
    raise ValueError("the block DISP of the .frd file has no end mark: the file is cut off")


def read_blocks(text: str, title: str) -> tuple[npt.NDArray[np.float64], list[Nodal]]:
    """Return the times (k,) [s] and nodal values of every block of a ``.dat`` file that begins with ``title``.

    Raises:
        ValueError: if there is no such block.
    """
    times, blocks, inside = [], [], False
    for fields in filter(None, map(str.split, text.splitlines())):
        if not fields[0].isdigit():
            inside = fields[0] == title
            if inside:
                times.append(float(fields[-1]))
                blocks.append({})
        elif inside:
            blocks[-1][int(fields[0])] = (float(fields[1]), float(fields[2]), float(fields[3]))
    if not blocks:
        raise ValueError(f"the .dat file holds no {title}: did the analysis end early?")
    return np.array(times), blocks


def read_total_forces(text: str) -> list[tuple[float, float, float]]:
    """Return the total force of every step in a ``.dat`` file (``TOTALS=ONLY``).

    Raises:
        ValueError: if there is no total force.
    """
    lines = [line.split() for line in text.splitlines()]
    found = [
        next(fields for fields in lines[i + 1 :] if fields)
        for i, line in enumerate(lines)
        if line[:3] == ["total", "force", "(fx,fy,fz)"]
    ]
    if not found:
        raise ValueError("the .dat file holds no total forces: did the analysis end early?")
    return [(float(x), float(y), float(z)) for x, y, z in found]


def count_iterations(text: str) -> int:
    """Return the number of linear solves that the log of ``ccx`` reports."""
    return sum(line.strip().startswith("iteration ") for line in text.splitlines())


def to_lattice(values: Nodal, *, size: int) -> npt.NDArray[np.float64]:
    """Return nodal values as an array, shape (size, 3), float64; missing nodes have zeros.

    Raises:
        ValueError: if a node number is outside 1..size.
    """
    result = np.zeros((size, 3))
    for node, value in values.items():
        if not 1 <= node <= size:
            raise ValueError(f"node {node} lies outside 1..{size}")
        result[node - 1] = value
    return result

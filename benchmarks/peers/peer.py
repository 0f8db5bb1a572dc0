# SPDX-License-Identifier: Apache-2.0
"""What every peer of the benchmark provides, and how one is run: alone, in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, cast

import numpy as np
import numpy.typing as npt

from benchmarks.cases import Case, CaseName
from benchmarks.grids import Grid
from gdfe_ros.errors import GdfeError
from gdfe_ros.workers import THREAD_COUNTS

Array = npt.NDArray[np.float64]
Setting = float | int | bool | str

_THREAD_VARIABLES = (
    *THREAD_COUNTS,
    "CCX_NPROC_EQUATION_SOLVER",
    "CCX_NPROC_RESULTS",
    "CCX_NPROC_STIFFNESS",
)
_WORKER = "benchmarks.peers.worker"
_ROOT = Path(__file__).resolve().parents[2]


class Solver(Enum):
    """Ours, and the solvers that the benchmark stands beside."""

    GDFE = "gdfe"
    FELUPE = "felupe"
    CALCULIX = "calculix"
    MUJOCO = "mujoco"


class PeerError(GdfeError):
    """A peer that is missing or whose run failed."""


@dataclass(frozen=True, kw_only=True)
class Variant:
    """One method to run a peer on a scene.

    Attributes:
        label: name for tables, e.g. ``C3D8I 50x5x5``.
        element: the peer's own name of the element.
        cells: hexahedra along x, y, z.
        steps: load steps.
        options: settings that only this peer knows.
        slow: whether a run takes more than ten seconds, for callers in a hurry.
    """

    label: str
    element: str
    cells: tuple[int, int, int]
    steps: int = 1
    options: Mapping[str, Setting] = field(default_factory=dict)
    slow: bool = False


@dataclass(frozen=True, kw_only=True)
class PeerSolution:
    """One run of a peer.

    Attributes:
        displacement: at the points asked for, shape (n, 3), float64 [m].
        reaction: what the right face exerts on the body, shape (6,): force [N], then moment about
            the face's deformed centre [N m].
        time_setup: building the model [s].
        time_solve: solving it [s].
        settings: what was used, by name.
    """

    displacement: Array
    reaction: Array
    time_setup: float
    time_solve: float
    settings: dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class PeerResult:
    """A peer's place in the benchmark; times are medians, start-up and imports excluded.

    Attributes:
        solver: which peer.
        label: the variant's name.
        scene: name of the scene.
        mesh: cells and element, e.g. ``50x5x5 C3D8I``.
        time_setup: building the model [s].
        time_solve: solving it, cold, from rest [s].
        mean_error: mean of ``|x - x_ref|`` over mean of ``|u_ref|`` (fraction).
        max_error: maximum of ``|x - x_ref|`` over maximum of ``|u_ref|`` (fraction).
        reaction: force [N] and moment [N m] that the right face exerts on the body.
        settings: what was used: versions, steps, tolerance, law, threads, runs, warnings.
    """

    solver: Solver
    label: str
    scene: str
    mesh: str
    time_setup: float
    time_solve: float
    mean_error: float
    max_error: float
    reaction: tuple[float, float, float, float, float, float]
    settings: dict[str, Any]

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain JSON types."""
        return asdict(self) | {"solver": self.solver.value, "reaction": list(self.reaction)}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> PeerResult:
        """Return the result that `to_json` wrote."""
        values = dict(data)
        values["solver"] = Solver(values["solver"])
        values["reaction"] = tuple(values["reaction"])
        return cls(**values)


class Peer(Protocol):
    """The functions that the module of a peer provides."""

    def available(self) -> str | None:
        """Return None if the peer can run here, else the reason why not and the remedy."""

    def variants(self, case: Case) -> tuple[Variant, ...]:
        """Return the runs worth showing on a scene; empty if the peer cannot do the scene."""

    def solve(self, case: Case, variant: Variant, points: Array) -> PeerSolution:
        """Run once and return the solution at undeformed positions ``points``, shape (n, 3) [m]."""


def load_peer(solver: Solver) -> Peer:
    """Return the module of a peer; its solver is only imported when it runs."""
    return cast(Peer, import_module(f"benchmarks.peers.{solver.value}_peer"))


def run_peer(
    solver: Solver,
    name: CaseName,
    variant: Variant,
    *,
    repeats: int = 3,
    threads: int = 1,
    timeout: float = 600.0,
    reference_directory: Path | None = None,
) -> PeerResult:
    """Run a peer in a fresh process with pinned threads and measure it.

    Args:
        solver: which peer.
        name: the scene.
        variant: one of `Peer.variants`, or one made up.
        repeats: timed runs; the median counts. A run of five seconds or more is not repeated.
        threads: threads that libraries in the process may use.
        timeout: limit on all runs together [s].
        reference_directory: where the reference solutions are, by default in the checkout.

    Raises:
        PeerError: if the peer is missing, fails or takes longer than ``timeout``.
    """
    reason = load_peer(solver).available()
    if reason is not None:
        raise PeerError(f"{solver.value} cannot run: {reason}")
    request = {
        "solver": solver.value,
        "scene": name.value,
        "variant": asdict(variant),
        "repeats": repeats,
        "threads": threads,
        "reference_directory": str(reference_directory) if reference_directory else None,
    }
    where = f"{solver.value}, {name.value}, {variant.label}"
    with tempfile.TemporaryDirectory(prefix="gdfe_peer_") as folder:
        request_path, result_path = Path(folder, "request.json"), Path(folder, "result.json")
        request_path.write_text(json.dumps(request))
        command = [sys.executable, "-m", _WORKER, str(request_path), str(result_path)]
        try:
            process = subprocess.run(
                command,
                cwd=folder,
                env=worker_environment(threads),
                capture_output=True,
                text=True,
                timeout=timeout,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise PeerError(f"{where}: no result within {timeout:g} s; raise the timeout") from None
        if process.returncode != 0 or not result_path.is_file():
            tail = "\n".join((process.stderr or process.stdout).strip().splitlines()[-6:])
            raise PeerError(f"{where}: the worker ended with status {process.returncode}:\n{tail}")
        return PeerResult.from_json(json.loads(result_path.read_text()))


def handle_reaction(grid: Grid, displacement: Array, forces: Array) -> Array:
    """Return the wrench of nodal forces on the right face.

    Args:
        grid: the lattice of nodes.
        displacement: of every node, shape (n, 3), float64 [m].
        forces: what acts on the body at every node, shape (n, 3), float64 [N].

    Returns:
        Force [N], then moment about the mean of the face's deformed nodes [N m], shape (6,).
    """
    face = grid.face(right=True)
    deformed = (grid.points() + displacement)[face]
    moment = np.cross(deformed - deformed.mean(axis=0), forces[face]).sum(axis=0)
    return np.concatenate([forces[face].sum(axis=0), moment])


def worker_environment(threads: int) -> dict[str, str]:
    """Return the environment of a worker: threads pinned, this package importable."""
    path = os.pathsep.join(filter(None, [str(_ROOT), os.environ.get("PYTHONPATH", "")]))
    pinned = dict.fromkeys(_THREAD_VARIABLES, str(threads))
    return {**os.environ, **pinned, "PYTHONPATH": path, "FELUPE_VERBOSE": "false"}

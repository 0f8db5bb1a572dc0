# SPDX-License-Identifier: Apache-2.0
"""Interface of the benchmark's peers (other solvers), and runs of a peer in a separate process."""

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
    """Our solver, and the solvers with which the benchmark compares it."""

    GDFE = "gdfe"
    FELUPE = "felupe"
    CALCULIX = "calculix"
    MUJOCO = "mujoco"


class PeerError(GdfeError):
    """A peer that is not installed, or whose run failed."""


@dataclass(frozen=True, kw_only=True)
class Variant:
    """Settings for running a peer on a scene.

    Attributes:
        label: name for tables, e.g. ``C3D8I 50x5x5``.
        element: the peer's name of the element.
        cells: numbers of hexahedra along x, y, z.
        steps: number of load steps.
        options: settings that only this peer has.
    """

    label: str
    element: str
    cells: tuple[int, int, int]
    steps: int = 1
    options: Mapping[str, Setting] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class PeerSolution:
    """Result of one run of a peer.

    Attributes:
        displacement: displacements at the requested points, shape (n, 3), float64 [m].
        reaction: wrench of the right face on the body, shape (6,): force [N], then moment about
            the face's deformed centre [N m].
        time_setup: time of building the model [s].
        time_solve: time of solving it [s].
        settings: dict from name to setting.
    """

    displacement: Array
    reaction: Array
    time_setup: float
    time_solve: float
    settings: dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class PeerResult:
    """Result of a variant of a peer; times are medians, without start-up and imports.

    Attributes:
        solver: the peer.
        label: name of the variant.
        scene: name of the scene.
        mesh: cells and element, e.g. ``50x5x5 C3D8I``.
        time_setup: time of building the model [s].
        time_solve: time of solving it from the undeformed state [s].
        mean_error: mean of ``|x - x_ref|`` divided by the mean of ``|u_ref|`` (fraction).
        max_error: maximum of ``|x - x_ref|`` divided by the maximum of ``|u_ref|`` (fraction).
        reaction: force [N] and moment [N m] of the right face on the body.
        settings: settings of the run: versions, steps, tolerance, law, threads, runs, warnings.
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
        """Return the variants that are shown for a scene; empty if the peer cannot solve the scene."""

    def solve(self, case: Case, variant: Variant, points: Array) -> PeerSolution:
        """Run a variant once; return the solution at undeformed positions ``points``, shape (n, 3) [m]."""


def load_peer(solver: Solver) -> Peer:
    """Return the module of a peer. The peer's solver is only imported when it runs."""
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
    """Run a peer in a new process with a fixed number of threads, and measure it.

    Args:
        solver: the peer.
        name: name of the scene.
        variant: one of `Peer.variants`, or any other variant.
        repeats: number of timed runs; the result is their median. A run of five seconds or more is
            not repeated.
        threads: number of threads that libraries in the process may use.
        timeout: time limit of all runs together [s].
        reference_directory: folder of the reference solutions, by default in the checkout.

    Raises:
        PeerError: if the peer is not installed, fails or takes longer than ``timeout``.
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
    """Return the wrench of the nodal forces on the right face.

    Args:
        grid: lattice of nodes.
        displacement: displacements of all nodes, shape (n, 3), float64 [m].
        forces: external forces on the body at all nodes, shape (n, 3), float64 [N].

    Returns:
        Force [N], then moment about the mean of the face's deformed nodes [N m], shape (6,).
    """
    face = grid.face(right=True)
    deformed = (grid.points() + displacement)[face]
    moment = np.cross(deformed - deformed.mean(axis=0), forces[face]).sum(axis=0)
    return np.concatenate([forces[face].sum(axis=0), moment])


def worker_environment(threads: int) -> dict[str, str]:
    """Return the environment variables of a worker, which limit its threads and make this package importable."""
    path = os.pathsep.join(filter(None, [str(_ROOT), os.environ.get("PYTHONPATH", "")]))
    pinned = dict.fromkeys(_THREAD_VARIABLES, str(threads))
    return {**os.environ, **pinned, "PYTHONPATH": path, "FELUPE_VERBOSE": "false"}

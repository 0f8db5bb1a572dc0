# SPDX-License-Identifier: Apache-2.0
"""Interface of the benchmark's peers (other solvers), and runs of a peer in a process of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field
from enum import Enum
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, cast

import numpy as np
import numpy.typing as npt
import yaml

from benchmarks.cases import Case, CaseName
from benchmarks.grids import Grid
from benchmarks.process import PeerError, run_module

Array = npt.NDArray[np.float64]
Setting = float | int | bool | str
VARIANTS = Path(__file__).with_name("variants.yaml")
"""File of what is run of each solver on each scene."""


class Solver(str, Enum):
    """Our solver, and the solvers with which the benchmark compares it."""

    GDFE = "gdfe"
    FELUPE = "felupe"
    CALCULIX = "calculix"
    MUJOCO = "mujoco"


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

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> PeerResult:
        """Return the result from its fields as plain JSON types."""
        return cls(**{**data, "solver": Solver(data["solver"]), "reaction": tuple(data["reaction"])})


class Peer(Protocol):
    """The functions that the module of a peer provides."""

    def available(self) -> str | None:
        """Return None if the peer can run here, else the reason why not and the remedy."""

    def solve(self, case: Case, variant: Variant, points: Array) -> PeerSolution:
        """Run a variant once; return the solution at undeformed positions ``points``, shape (n, 3) [m]."""


def load_peer(solver: Solver) -> Peer:
    """Return the module of a peer. The peer's solver is only imported when it runs."""
    return cast(Peer, import_module(f"benchmarks.peers.{solver.value}_peer"))


@cache
def _read_families() -> dict[str, dict[str, list[dict[str, Any]]]]:
    return yaml.safe_load(VARIANTS.read_text(encoding="utf-8"))


def list_variants(solver: Solver, case: Case) -> list[Variant]:
    """Return the variants of a scene in `VARIANTS`; empty if the peer cannot solve the scene."""
    found = []
    for family in _read_families()[solver.value].get(case.name.value, ()):
        element, meshes, steps = family["element"], family["cells"], family.get("steps", 1)
        options = {name: value for name, value in family.items() if name not in ("element", "cells", "steps")}
        tail = f" {options['tolerance']:g}" if "tolerance" in options else ""
        tail += f", {steps} steps" if "stream" in options else ""
        for mesh in meshes:
            cells = tuple(map(int, mesh.split("x")))
            label = f"{element} {mesh}{tail}"
            found.append(Variant(label=label, element=element, cells=cells, steps=steps, options=options))
    return found


def attempt(name: str, peer: Any, runs: Iterable[Any], measure: Callable[[Any], Any]) -> tuple[list[Any], list[str]]:
    """Return what ``measure`` finds for each run of a peer's module, and texts about a missing peer or failed runs."""
    if reason := peer.available():
        return [], [f"{name}: {reason}"]
    rows, failures = [], []
    for run in runs:
        try:
            rows.append(measure(run))
        except PeerError as error:
            failures.append(str(error))
    return rows, failures


def run_peer(
    solver: Solver,
    name: CaseName,
    variant: Variant,
    *,
    repeats: int = 3,
    threads: int = 1,
    timeout: float = 600.0,
) -> PeerResult:
    """Run a peer in a new process with a fixed number of threads, and measure it.

    Args:
        solver: the peer.
        name: name of the scene.
        variant: one of `list_variants`, or any other variant.
        repeats: number of timed runs; the result is their median. A run of five seconds or more is
            not repeated.
        threads: number of threads that libraries in the process may use.
        timeout: time limit of all runs together [s].

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
    }
    where = f"{solver.value}, {name.value}, {variant.label}"
    return PeerResult.from_json(run_module("benchmarks.peers.worker", request, where, timeout=timeout, threads=threads))


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

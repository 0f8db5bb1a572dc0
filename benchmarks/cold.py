# SPDX-License-Identifier: Apache-2.0
"""First part of the benchmark: every solver on its meshes, with one step or a stream of small steps."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from benchmarks.cases import Case, CaseName, get_case
from benchmarks.peers.peer import PeerError, PeerResult, Solver, Variant, load_peer, run_peer

ALL_THREADS = (CaseName.BEND5, CaseName.TWIST90)
"""Scenes that are solved on the paper's mesh a second time, with all threads."""


@dataclass(frozen=True)
class Job:
    """One run of the benchmark: solver, scene, variant and number of threads."""

    solver: Solver
    case: Case
    variant: Variant
    threads: int


def jobs(*, slow: bool, threads: int, streams: bool = False) -> list[Job]:
    """Return the runs of all installed solvers.

    Args:
        slow: whether runs of more than ten seconds are included.
        threads: number of threads of the machine.
        streams: whether streams of small steps are returned instead of cold solves.
    """
    wanted = []
    for solver in Solver:
        peer = load_peer(solver)
        if peer.available() is not None:
            continue
        for name in CaseName:
            case = get_case(name)
            chosen = [
                variant
                for variant in peer.variants(case)
                if (slow or not variant.slow) and bool(variant.options.get("stream")) == streams
            ]
            wanted += [Job(solver, case, variant, 1) for variant in chosen]
            if threads > 1 and name in ALL_THREADS and not streams:
                fine = [variant for variant in chosen if variant.cells == case.cells]
                wanted += [Job(solver, case, variant, threads) for variant in fine[:1]]
    return wanted


def missing() -> dict[str, str]:
    """Return dict from solver that cannot run here to the reason and remedy."""
    reasons = {solver.value: load_peer(solver).available() for solver in Solver}
    return {name: reason for name, reason in reasons.items() if reason is not None}


def run_jobs(
    wanted: Iterable[Job], *, repeats: int, done: Callable[[Job, PeerResult | PeerError], None]
) -> list[PeerResult]:
    """Run the jobs in order, pass each result or error to ``done``, and return the results without failed runs."""
    results = []
    for job in wanted:
        try:
            result = run_peer(job.solver, job.case.name, job.variant, repeats=repeats, threads=job.threads)
        except PeerError as error:
            done(job, error)
            continue
        results.append(result)
        done(job, result)
    return results

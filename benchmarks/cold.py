# SPDX-License-Identifier: Apache-2.0
"""First part of the benchmark: every solver on its own meshes, in one step or in streams of small steps."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from benchmarks.cases import Case, CaseName, get_case
from benchmarks.peers.peer import PeerError, PeerResult, Solver, Variant, load_peer, run_peer

ALL_THREADS = (CaseName.BEND5, CaseName.TWIST90)
"""Scenes whose paper's mesh is solved once more with all threads."""


@dataclass(frozen=True)
class Job:
    """One run to make: which solver, scene and variant, with how many threads."""

    solver: Solver
    case: Case
    variant: Variant
    threads: int


def jobs(*, slow: bool, threads: int, streams: bool = False) -> list[Job]:
    """List the runs of all solvers that are installed.

    Args:
        slow: adds those of more than ten seconds.
        threads: of the machine.
        streams: those of small steps instead of the cold ones.
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
    """Return the solvers that cannot run here with the reason and the remedy."""
    reasons = {solver.value: load_peer(solver).available() for solver in Solver}
    return {name: reason for name, reason in reasons.items() if reason is not None}


def run_jobs(
    wanted: Iterable[Job], *, repeats: int, done: Callable[[Job, PeerResult | PeerError], None]
) -> list[PeerResult]:
    """Run the jobs one after the other; a run that fails is handed to ``done`` and left out."""
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

# SPDX-License-Identifier: Apache-2.0
"""First part of the benchmark: every solver on its meshes, with one step or a stream of small steps."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from benchmarks.cases import Case, CaseName, get_case
from benchmarks.peers.peer import PeerError, PeerResult, Solver, Variant, load_peer, run_peer


@dataclass(frozen=True)
class Job:
    """One run of the benchmark: solver, scene and variant."""

    solver: Solver
    case: Case
    variant: Variant


def jobs(*, streams: bool = False) -> list[Job]:
    """Return the cold solves of all installed solvers, or their streams of small steps."""
    wanted = []
    for solver in Solver:
        peer = load_peer(solver)
        if peer.available() is not None:
            continue
        for name in CaseName:
            case = get_case(name)
            chosen = [item for item in peer.variants(case) if bool(item.options.get("stream")) == streams]
            wanted += [Job(solver, case, variant) for variant in chosen]
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
            result = run_peer(job.solver, job.case.name, job.variant, repeats=repeats)
        except PeerError as error:
            done(job, error)
            continue
        results.append(result)
        done(job, result)
    return results

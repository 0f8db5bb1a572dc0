# SPDX-License-Identifier: Apache-2.0
"""First part of the benchmark: every solver on its meshes, with one step or a stream of small steps."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable

from benchmarks.cases import CASES, Case, CaseName
from benchmarks.peers.peer import PeerError, PeerResult, Solver, Variant, list_variants, load_peer, run_peer

Job = tuple[Solver, Case, Variant]
"""One run of the benchmark."""


def jobs(*, streams: bool = False) -> list[Job]:
    """Return the cold solves of all installed solvers, or their streams of small steps."""
    wanted = []
    for solver in Solver:
        if load_peer(solver).available() is not None:
            continue
        for name in CaseName:
            case = CASES[name]
            chosen = [item for item in list_variants(solver, case) if ("stream" in item.options) == streams]
            wanted += [(solver, case, variant) for variant in chosen]
    return wanted


def missing() -> dict[str, str]:
    """Return dict from solver that cannot run here to the reason and remedy."""
    reasons = {solver.value: load_peer(solver).available() for solver in Solver}
    return {name: reason for name, reason in reasons.items() if reason is not None}


def run_jobs(
    wanted: Iterable[Job], repeats: int, describe: Callable[[PeerResult], str]
) -> tuple[list[PeerResult], list[str]]:
    """Run the jobs in order; print what each found, as ``describe`` says; return the results, and texts of failures."""
    results, failures = [], []
    for solver, case, variant in wanted:
        try:
            results.append(run_peer(solver, case.name, variant, repeats=repeats))
            outcome = describe(results[-1])
        except PeerError as error:
            failures.append(outcome := str(error))
        print(f"{solver.value} {case.name.value} {variant.label}: {outcome}", file=sys.stderr)
    return results, failures

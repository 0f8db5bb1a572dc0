# SPDX-License-Identifier: Apache-2.0
"""Process that runs one peer: ``python -m benchmarks.peers.worker REQUEST`` prints its result."""

from __future__ import annotations

import json
import statistics
import sys
import warnings
from dataclasses import asdict
from typing import Any

from benchmarks.cases import CASES, Case, CaseName
from benchmarks.peers.peer import Peer, PeerResult, PeerSolution, Solver, Variant, load_peer
from benchmarks.references import Reference, load_reference, measure_error

WARM = 1.0
"""Time [s] below which the first run is not counted, because it warms up caches and allocators."""
LONG = 5.0
"""Time [s] from which a run is not repeated."""


def measure(peer: Peer, case: Case, variant: Variant, reference: Reference, *, repeats: int) -> list[PeerSolution]:
    """Run a peer ``repeats`` times and return the counted runs; see `WARM` and `LONG`."""
    runs = [peer.solve(case, variant, reference.vertices)]
    if runs[0].time_solve < WARM:
        runs = [peer.solve(case, variant, reference.vertices)]
    while len(runs) < repeats and runs[0].time_solve < LONG:
        runs.append(peer.solve(case, variant, reference.vertices))
    return runs


def run(request: dict[str, Any]) -> PeerResult:
    """Run the peer of a request from `benchmarks.peers.peer.run_peer`, and return its result."""
    solver, case = Solver(request["solver"]), CASES[CaseName(request["scene"])]
    fields = request["variant"]
    variant = Variant(**{**fields, "cells": tuple(fields["cells"])})
    reference = load_reference(case.name)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        runs = measure(load_peer(solver), case, variant, reference, repeats=int(request["repeats"]))
    last = runs[-1]
    error = measure_error(last.displacement, reference.displacement)
    texts = sorted({str(item.message) for item in caught}) + list(last.settings.pop("warnings", []))
    return PeerResult(
        solver=solver,
        label=variant.label,
        scene=case.name.value,
        mesh=f"{'x'.join(map(str, variant.cells))} {variant.element}",
        time_setup=statistics.median(item.time_setup for item in runs),
        time_solve=statistics.median(item.time_solve for item in runs),
        mean_error=error.mean,
        max_error=error.maximum,
        reaction=tuple(float(value) for value in last.reaction),
        settings={
            **last.settings,
            "steps": variant.steps,
            "threads": int(request["threads"]),
            "runs": len(runs),
            "warnings": texts,
        },
    )


if __name__ == "__main__":
    print(json.dumps(asdict(run(json.loads(sys.argv[1])))))

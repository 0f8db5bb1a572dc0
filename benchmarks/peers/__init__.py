# SPDX-License-Identifier: Apache-2.0
"""Other solvers (peers) of the benchmark, each with the same few functions."""

from benchmarks.peers.peer import (
    PeerError,
    PeerResult,
    PeerSolution,
    Solver,
    Variant,
    load_peer,
    run_peer,
)

__all__ = ["PeerError", "PeerResult", "PeerSolution", "Solver", "Variant", "load_peer", "run_peer"]

# SPDX-License-Identifier: Apache-2.0
"""Plays scenes on demand, with whichever commit's package it is started: the other half of `benchmarks.since`.

Reads lines ``scene steps overrides`` of JSON; plays the scene's program from rest in so many steps (null: as its
settings say) and answers with the processor time [s], the iterations, and a digest of where the body is in the end.
Nothing but the standard library and what the package has always had is imported: old commits must run it, too.
"""

import hashlib
import json
import sys
import time

from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation


def play(simulation: Simulation, steps: "int | None") -> "dict[str, object]":
    """Play a program once, from rest."""
    simulation.reset()
    started = time.process_time()
    results = list(simulation.play(steps))
    return {
        "seconds": time.process_time() - started,
        "steps": len(results),
        "iterations": sum(result.iterations for result in results),
        "digest": hashlib.sha256(results[-1].positions.tobytes()).hexdigest(),
    }


def main() -> None:
    """Answer every line that is read; a scene is loaded and its kernels are compiled when it is first named."""
    simulations = {}
    for line in sys.stdin:
        scene, steps, overrides = json.loads(line)
        if line not in simulations:
            simulations[line] = Simulation(load_scene(scene, overrides=overrides))
            play(simulations[line], steps)
        print(json.dumps(play(simulations[line], steps)), flush=True)


if __name__ == "__main__":
    main()

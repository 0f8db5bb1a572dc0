# SPDX-License-Identifier: Apache-2.0
"""Process that plays scenes on request with the package of some commit, for `benchmarks.since`.

It reads JSON lines ``scene steps overrides``, plays the scene's program from the initial state in this number of steps
(null: the number in the scene's settings), and prints the processor time [s], the iterations, and a digest of the
final positions. It imports only the standard library and modules that exist in all commits, so that old commits can
run it, too.
"""

import hashlib
import json
import sys
import time

from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation


def play(simulation: Simulation, steps: "int | None") -> "dict[str, object]":
    """Play a program once from the initial state; return processor time [s], iterations and digest."""
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
    """Answer every line. At its first request, a scene is loaded and its kernels are compiled."""
    simulations = {}
    for line in sys.stdin:
        scene, steps, overrides = json.loads(line)
        if line not in simulations:
            simulations[line] = Simulation(load_scene(scene, overrides=overrides))
            play(simulations[line], steps)
        print(json.dumps(play(simulations[line], steps)), flush=True)


if __name__ == "__main__":
    main()

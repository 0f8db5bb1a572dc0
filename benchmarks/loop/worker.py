# SPDX-License-Identifier: Apache-2.0
"""Process that carries out tasks with the package of some commit, for `benchmarks.loop.process`.

It reads JSON lines ``{"work": ..., "task": ...}`` and prints a JSON line for each. Its modules use only the public
interface of the package, so that any commit can run them.
"""

from __future__ import annotations

import json
import sys
import traceback
from typing import Any

from benchmarks.loop.newton import measure_newton
from benchmarks.loop.playing import Player, drop_results
from benchmarks.loop.truth import measure_each, measure_path


def answer(request: dict[str, Any], players: dict[str, Player]) -> dict[str, Any]:
    """Carry out a request; ``players`` keeps the simulation of the last timed task."""
    task, work = request["task"], request["work"]
    if work == "each":
        return measure_each(task, request["fine"], request["bends"], request["path"], request["push"])
    if work == "newton":
        return {"steps": measure_newton(task, request["path"])}
    if work == "path":
        return measure_path(task, request["fine"], request["path"])
    key = json.dumps(task, sort_keys=True)
    if key not in players:
        players.clear()
        players[key] = Player(task)
        players[key].simulation.warm_up()
        players[key].play()
    runs = [drop_results(players[key].play()) for _ in range(request["repeats"])]
    return {"runs": runs, "setup": players[key].setup}


def main() -> None:
    """Answer every line; an error is answered with its text, and the process goes on."""
    players: dict[str, Player] = {}
    for line in sys.stdin:
        try:
            found = answer(json.loads(line), players)
        except Exception as error:  # the other commit may lack something; the table says so
            traceback.print_exc()
            found = {"failed": f"{type(error).__name__}: {error}"[:200]}
        print(json.dumps(found), flush=True)


if __name__ == "__main__":
    main()

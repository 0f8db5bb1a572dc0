# SPDX-License-Identifier: Apache-2.0
"""Records the bags of this directory with the shipped node, and replays each bag: ``make bags``.

Run it after a change that alters results on purpose. The tests replay the present bags.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.analysis.difference import Difference
from gdfe_ros.analysis.replay import Replay
from gdfe_ros.scene import load_scene
from gdfe_ros.testing.node_replay import play_program

HERE = Path(__file__).resolve().parent
TOLERANCE = 1e-8
LIMIT = 5_000_000
BEGIN, END = "<!-- made by bags/record.py: -->", "<!-- end -->"
HEADINGS = (
    "| bag | what it shows | vertices | steps | cut | not converged | tolerance | elsewhere within | simulated [s] | "
    "replay [s] |",
    "|---|---|" + 8 * "--:|",
)


@dataclass(frozen=True, kw_only=True)
class Recording:
    """Recipe of one bag: the program of a scene is played to the node over topics.

    Attributes:
        scene: name of the scene.
        steps: number of steps into which the program is divided.
        dt: simulation time of a step [s]; if steps * dt exceeds the program's duration, the program is played slower.
        shows: contents of the bag, for the README.
        within: allowed difference of a replay on another processor, in multiples of the solver's tolerance. It is 10
            for bags of equilibria, and 1000 if deadlines end solves, because the distance to the equilibrium is then
            unknown.
        overrides: overrides of the scene, in addition to the tolerance.
        parameters: parameters of the node, in addition to those for lockstep and recording.
    """

    scene: str
    steps: int
    shows: str
    within: float = 10.0
    dt: float = 1.0
    overrides: Mapping[str, str] = field(default_factory=dict)
    parameters: Mapping[str, object] = field(default_factory=dict)


RECORDINGS = {
    "bend5": Recording(
        scene="bend5",
        steps=12,
        shows="Sec. 5.1 of the paper: five segments from 100 to 20 kPa, the right face lifted by 0.20 m",
    ),
    "twist90": Recording(
        scene="twist90", steps=15, shows="Sec. 5.2: a bar of Cheetah and NinjaFlex turned by 90 degrees"
    ),
    "tensile": Recording(
        scene="tensile", steps=15, shows="Sec. 5.3: Cheetah and NinjaFlex in series, stretched by 100 %"
    ),
    "tendon_finger": Recording(
        scene="tendon_finger",
        steps=16,
        dt=2.0,
        shows="a robot with two cables that pull against each other; tensions and lengths on `joint_states`",
        overrides={"solver.max_iterations": "10000"},
    ),
    "pneunet": Recording(
        scene="pneunet",
        steps=8,
        dt=4.0,
        shows="a robot curled by air; pressure and volume on `joint_states`, probes at its tip",
        overrides={"solver.max_iterations": "10000"},
    ),
    "bend5_wall": Recording(
        scene="bend5",
        steps=40,
        dt=0.05,
        shows="the wall clock at 20 Hz with a deadline of 1 ms that cuts most solves: the bag holds which "
        "command each step took, and where each solve was cut",
        within=1000.0,
        overrides={"mesh.bar.cells": "[25, 2, 2]"},
        parameters={"clock": "wall", "rate": 20.0, "deadline": 0.001, "command_set": [""]},
    ),
}


def main() -> int:
    """Record all bags, or the bags named on the command line, and return the exit status.

    It is 0 if every replay is bit-identical and all bags together have at most `LIMIT` bytes, 1 if not, and 2 if a name
    is unknown.
    """
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    unknown = sorted(set(sys.argv[1:]) - set(RECORDINGS))
    if unknown:
        print(f"no recording {', '.join(unknown)}; recordings: {', '.join(RECORDINGS)}", file=sys.stderr)
        return 2
    passed = [make(name) for name in sys.argv[1:] or RECORDINGS]
    describe()
    size = sum(file.stat().st_size for file in HERE.glob("*/*"))
    print(f"{size / 1e6:.2f} MB in all bags; allowed: {LIMIT / 1e6:g} MB")
    return 0 if all(passed) and size <= LIMIT else 1


def describe() -> None:
    """Replay every bag, and write the table of the README."""
    readme = HERE / "README.md"
    rows = [row(name) for name in RECORDINGS if (HERE / name).is_dir()]
    before, _, rest = readme.read_text(encoding="utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    table = "\n".join(["", "", *HEADINGS, *rows, "", ""])
    readme.write_text(f"{before}{BEGIN}{table}{END}{after}", encoding="utf-8")
    print("\n".join(rows))


def row(name: str) -> str:
    """Replay a bag and return its row in the table of the README."""
    run, recording = BagRun(HERE / name), RECORDINGS[name]
    report = Replay(run).run()
    cut = sum(record.cut for record in run.records)
    missed = sum(not record.converged and not record.cut for record in run.records)
    cells = (
        f"`{name}`",
        recording.shows,
        f"{run.scene.mesh.n_vertices}",
        f"{len(run.records)}",
        f"{cut}",
        f"{missed}",
        f"{run.scene.solver.tolerance:g}",
        f"{recording.within:g}",
        f"{report.duration:.3g}",
        f"{report.wall_time:.2g}",
    )
    return f"| {' | '.join(cells)} |"


def make(name: str) -> bool:
    """Record one bag in place of the old one, replay it, and return whether the replay is bit-identical."""
    target, fresh = HERE / name, HERE / f".{name}"
    shutil.rmtree(fresh, ignore_errors=True)
    record(RECORDINGS[name], fresh / name)
    report = Replay(BagRun(fresh / name)).run()
    shutil.rmtree(target, ignore_errors=True)
    (fresh / name).rename(target)
    fresh.rmdir()
    verdict = report.differences.verdict()
    print(
        f"{name}: {report.differences.steps} steps, {report.cuts} cut by a deadline; {report.duration:.3g} s of "
        f"simulation replayed in {report.wall_time:.3g} s: {verdict.value}"
    )
    return verdict is Difference.IDENTICAL


def record(recording: Recording, bag: Path) -> None:
    """Play the scene's program to a node that records the bag.

    Raises:
        GdfeError: the node ended or did not respond.
    """
    overrides = {"solver.tolerance": f"{TOLERANCE:g}", **recording.overrides}
    scene = load_scene(recording.scene, overrides=overrides)
    changes = {"scene_overrides": [f"{key}={value}" for key, value in overrides.items()], **recording.parameters}
    play_program(scene, recording.scene, bag=bag, dt=recording.dt, steps=recording.steps, parameters=changes)


if __name__ == "__main__":
    sys.exit(main())

# SPDX-License-Identifier: Apache-2.0
"""A soft hand on a stock arm picks a rigid box and a soft cube: one command records the run, replays it and reports it.

    python -m gdfe_ros.examples.pick pick_ur5e --out runs/pick

`Picker` commands the simulation node in another process, in lockstep. The bag is replayed without ROS, and compared.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from rich.table import Table

from gdfe_ros.actuators import Mode
from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.analysis.difference import Difference
from gdfe_ros.analysis.replay import Replay
from gdfe_ros.errors import GdfeError
from gdfe_ros.examples.picker import Picker
from gdfe_ros.examples.soft_grip import GripSchedule, SoftGrip, force_limit
from gdfe_ros.recording.bag_info import make_run_folder
from gdfe_ros.scene.scene import Scene
from gdfe_ros.testing import PublishedState, Simulator
from gdfe_ros.untrusted.regular_file import make_name
from gdfe_ros.untrusted.terminal import PlainConsole

FORCE, STRAIN = 1.2, 0.03
"""Wanted force of one side [N], and largest allowed strain of the soft cube."""
GRAVITY = np.array([0.0, 0.0, -9.81])
SOFT, RIGID = "ecoflex", "box"
"""Material of the soft object, and name of the rigid object."""
SPAN = 8
"""Number of steps over which forces and accelerations are averaged in the check of their balance."""
LIFTED = 1e-4
"""An object counts as lifted, without support by the table, if its lowest corner is more than this above it [m]."""
CONTACT = 4e-4
"""Area [m^2] of a fingertip's contact: 20 mm wide and 20 mm high."""


def forces_of(scene: Scene, strain: float = STRAIN) -> list[float]:
    """Return the wanted forces [N] of one side of the hand on the box, and on the cube with a limited ``strain``."""
    return [FORCE, min(FORCE, force_limit(strain, young=scene.materials[SOFT].young0, area=CONTACT))]


def make_schedule(scene: Scene, forces: Sequence[float]) -> GripSchedule:
    """Return the controller of a scene's fingers: the first is on one side of the hand, all others on the other side.

    Pressures change by at most 80 kPa/s, tensions by 6 N/s.

    Args:
        scene: the scene.
        forces: wanted force [N] of one side, for each time that the hand closes.
    """
    first, *others = scene.actuators
    fractions = {first.name: 1.0} | {each.name: 1.0 / len(others) for each in others}
    low, high = first.low, first.high
    rate = 80e3 if first.mode is Mode.PRESSURE else 6.0
    grip = SoftGrip(fractions, rate=rate, gain=3.0 * rate, low=max(low, -0.125 * rate), high=high)
    return GripSchedule(scene.program, grip, forces=forces, dt=scene.dynamics.step)


def pick(scene: str, *, bag: Path, duration: float | None = None, strain: float = STRAIN) -> list[PublishedState]:
    """Let a `Picker` command a node that records; return the state of each step.

    Args:
        scene: name or path of the scene.
        bag: directory of the bag.
        duration: simulated time [s]; None: that of the program.
        strain: largest allowed strain of the soft cube.

    Raises:
        GdfeError: a trajectory was refused or not followed, or a step did not converge.
    """
    with Simulator(scene, inputs=("actuation",), bag=bag) as simulator:
        scene = simulator.scene
        dt = scene.dynamics.step
        schedule = make_schedule(scene, forces_of(scene, strain))
        picker = Picker(scene, simulator.name, schedule, context=simulator.context)
        states = simulator.spin(picker, steps=round((duration or scene.program.duration) / dt))
        if any(picker.outcomes):
            raise GdfeError(f"trajectories ended with the error codes {picker.outcomes}; 0 is success")
    if bad := [state.time for state in states if not state.record.converged]:
        raise GdfeError(f"steps did not converge at {', '.join(f'{time:g} s' for time in bad[:5])}")
    return states


def soft_cells(scene: Scene) -> NDArray[np.intp]:
    """Return the numbers of the soft object's cells."""
    return np.flatnonzero(scene.cell_material == list(scene.materials).index(SOFT))


def largest_strain(scene: Scene, states: Sequence[PublishedState]) -> float:
    """Return the largest equivalent strain of the soft object in any state."""
    return max(float(state.strain[soft_cells(scene), 3].max()) for state in states)


def balance_errors(
    mass: float, centres: NDArray[np.float64], lowest: NDArray[np.float64], forces: NDArray[np.float64], *, dt: float
) -> NDArray[np.float64]:
    """Return the errors of the balance of forces on an object, divided by its weight, while the object is lifted.

    There is an error for each window of `SPAN` steps. In a window, the mean force of the fingertips must be m (a - g),
    where a is the mean acceleration. Velocities are central differences of the centre of mass. Windows in which the
    object touches the table are left out.

    Args:
        mass: mass of the object [kg].
        centres: (n, 3) centre of mass after each step [m].
        lowest: (n,) height of the lowest corner over the table [m].
        forces: (n, 3) force of the fingertips on the object [N].
        dt: duration of a step [s].
    """
    velocities = (centres[2:] - centres[:-2]) / (2.0 * dt)
    accelerations = (velocities[SPAN:] - velocities[:-SPAN]) / (SPAN * dt)
    means = sliding_window_view(forces[2:-1], SPAN, axis=0).mean(axis=2)
    lifted = sliding_window_view(lowest > LIFTED, SPAN + 3).all(axis=1)
    errors = np.linalg.norm(means - mass * (accelerations - GRAVITY), axis=1) / (-mass * GRAVITY[2])
    return errors[lifted]


def soft_object(scene: Scene) -> tuple[float, NDArray[np.int32]]:
    """Return mass [kg] and corners (k, 8) of the cells of the soft object: a cuboid, whose cells have equal masses."""
    corners = scene.mesh.cells[soft_cells(scene)]
    size = np.ptp(scene.mesh.vertices[corners].reshape(-1, 3), axis=0)
    return scene.materials[SOFT].density * float(np.prod(size)), corners


def find_published_errors(scene: Scene, states: Sequence[PublishedState], *, soft: bool) -> NDArray[np.float64]:
    """Return the `balance_errors` of the soft or the rigid object in the states that the node published."""
    if soft:
        mass, corners = soft_object(scene)
        points = [state.positions.astype(float)[corners] for state in states]
        centres, lowest = [each.mean(axis=(0, 1)) for each in points], [each[..., 2].min() for each in points]
    else:
        body = next(each for each in scene.rigid_bodies if each.name == RIGID)
        frames = [body.frame(state.poses[RIGID]) for state in states]
        mass, centres = body.mass, [origin for origin, _ in frames]
        lowest = [(body.form.skin @ axes.T + origin)[:, 2].min() for origin, axes in frames]
    forces = [-sum(sensor[:3] for sensor in state.sensors.values()) for state in states]
    return balance_errors(mass, *map(np.array, (centres, lowest, forces)), dt=scene.dynamics.step)


def main(arguments: Sequence[str] | None = None) -> int:
    """Pick, replay, report; return 0 if the replay is bit-identical."""
    from gdfe_ros.analysis.report.report_writer import write_report

    parser = argparse.ArgumentParser(prog="pick", description=__doc__.partition("\n")[0])
    parser.add_argument("scene", nargs="?", default="pick_ur5e", help="pick_ur5e or pick_panda (default: pick_ur5e)")
    parser.add_argument("--out", type=Path, help="directory of the bag and the report (default: runs/<scene>_<time>)")
    parser.add_argument("--strain", type=float, default=STRAIN, help=f"limit of the cube's strain (default: {STRAIN})")
    parser.add_argument("--duration", type=float, help="simulated time [s] (default: the whole program)")
    given = parser.parse_args(arguments)
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    out = given.out or make_run_folder(make_name(Path(given.scene).stem))
    states = pick(given.scene, bag=out / "bag", duration=given.duration, strain=given.strain)
    run = BagRun(out / "bag")
    verdict = Replay(run).run().verdict()
    write_report(out / "bag", out / "report.html")
    console = PlainConsole(soft_wrap=True)
    console.print(_table(run.scene, states, given.strain, verdict))
    console.print(f"bag      {out / 'bag'}\nreport   {out / 'report.html'}")
    return 0 if verdict is Difference.IDENTICAL else 1


def _table(scene: Scene, states: Sequence[PublishedState], strain: float, verdict: Difference) -> Table:
    times = np.array([state.record.wall_time for state in states])
    table = Table(title=f"{scene.name}: {scene.description}", title_justify="left")
    table.add_column("quantity")
    table.add_column("value", justify="right")
    table.add_row("steps, simulated time", f"{len(states)}, {states[-1].time:.4g} s")
    table.add_row("solve time of a step, median", f"{1e3 * np.median(times):.1f} ms")
    for name, soft in ((RIGID, False), ("cube", True)):
        errors = find_published_errors(scene, states, soft=soft)
        value = f"{100.0 * errors.max():.2g} % in {len(errors)} steps" if len(errors) else "never lifted"
        table.add_row(f"{name}: largest error of the forces while lifted, over its weight", value)
    table.add_row("cube: largest strain, limit of the controller", f"{largest_strain(scene, states):.4f}, {strain:g}")
    table.add_row("replay of the bag", verdict.value)
    return table


if __name__ == "__main__":
    raise SystemExit(main())

# SPDX-License-Identifier: Apache-2.0
"""Time that skipped work saves: ``python -m benchmarks.savings [--out FILE]`` (``make bench-skip``).

Each row is a scene that is simulated twice with the same small steps, with a skip and without it. Times are processor
times, medians over the steps. The error is the mean distance between the two final states, divided by the largest
displacement.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from benchmarks.brush import RUBBER, Brush
from benchmarks.markdown import markdown_table
from benchmarks.replay import figures
from benchmarks.report import options, write_report
from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.materials import Law, Linear, Material, NeoHookean, preset
from gdfe_ros.mesh import bar
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.solver.settings import Skip

BRUSH = Brush()
STEPS, SETTLING, PROBED = 60, 10, 10
"""Number of steps of a motion, number of first steps that are not counted because they make factors, and number of
steps of the probe."""
LINEAR = Linear(young=1e5, poisson=0.45)
HYPERELASTIC: dict[str, Material] = {
    "neo-Hookean": RUBBER,
    "Ogden": preset("ninjaflex", law=Law.OGDEN, poisson=0.45),
    "curve": preset("ninjaflex", law=Law.CURVE, poisson=0.45),
}
Motion = Callable[[float], Command]
"""Function from a fraction of the motion, 0 to 1, to the command."""


@dataclass(frozen=True, eq=False)
class Run:
    """Result of a motion: undeformed and final positions (n, 3) [m], times [s] and idle elements of counted steps."""

    rest: NDArray[np.float64]
    positions: NDArray[np.float64]
    times: NDArray[np.float64]
    left: NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class Saving:
    """Effect of one skip in one scene.

    Attributes:
        scene, skip: names of scene and skip.
        elements: number of elements of the body.
        left: number of elements that the skip leaves out in the median step.
        time_without, time_with: median processor time of a step [s].
        mean_without, mean_with: mean processor time of a step [s].
        error: mean distance between the two final states, divided by the largest displacement; None if the two runs
            have different materials.
    """

    scene: str
    skip: str
    elements: int
    left: int
    time_without: float
    time_with: float
    mean_without: float
    mean_with: float
    error: float | None

    @property
    def row(self) -> tuple[str, ...]:
        """Texts of the row in the table."""
        error = "" if self.error is None else f"{100 * self.error:.4f} %"
        times = [f"{1e3 * value:.3g}" for value in (self.time_without, self.time_with)]
        ratio = [f"{100 * value:.3g} %" for value in self.ratios]
        return (self.scene, self.skip, f"{self.elements}", f"{self.left}", *times, *ratio, error)

    @property
    def ratios(self) -> tuple[float, float]:
        """Time with the skip divided by time without it, for the median and for the mean time of a step."""
        return self.time_with / self.time_without, self.mean_with / self.mean_without


HEAD = ("scene", "skip", "elements", "left out", "without [ms]", "with [ms]", "median", "mean", "error")


def play(scene: Scene, motion: Motion, counted: Skip) -> Run:
    """Simulate a motion in small steps, and return its result.

    Raises:
        RuntimeError: a step did not converge.
    """
    simulation = Simulation(scene)
    simulation.warm_up()
    times, left = [], []
    for step in range(1, STEPS + 1):
        begun = time.process_time()
        result = simulation.step(motion(step / STEPS), dt=0.01)
        times.append(time.process_time() - begun)
        left.append(result.skipped.get(counted.value, 0))
        if not result.converged:
            raise RuntimeError(f"{scene.name}, step {step}: {result.message}")
    return Run(scene.mesh.vertices, simulation.positions, np.array(times[SETTLING:]), np.array(left[SETTLING:]))


def saving(name: str, skip: Skip, scene: Scene, motion: Motion) -> Saving:
    """Simulate a motion without and with a skip, and return the comparison."""
    busy = replace(scene.solver, skip=tuple(set(Skip) - {skip}))
    without = play(replace(scene, solver=busy), motion, skip)
    found = play(scene, motion, skip)
    distance = np.linalg.norm(found.positions - without.positions, axis=1)
    error = float(distance.mean() / np.linalg.norm(without.positions - without.rest, axis=1).max())
    return _compared(name, skip.value, scene, without, found, error)


def savings() -> list[Saving]:
    """Return the savings of all skips."""
    return [repeated_saving(), *small_savings(), *linear_savings()]


def repeated_saving() -> Saving:
    """Return the saving if one command is repeated."""
    scene = BRUSH.scene(BRUSH.bristles)
    return saving("brush, no new command", Skip.SOLVE, scene, lambda _: BRUSH.bent([0], 0.1))


def small_savings() -> list[Saving]:
    """Return the savings of three bars: half of it in a handle, without pressures, with constant shape factors."""
    return [
        saving("bar, half of it in a handle", Skip.HANDLES, _bar(RUBBER, held=0.5), _lift),
        saving("bar, nu 0.3", Skip.PRESSURES, _bar(NeoHookean(young=1e5, poisson=0.3)), _lift),
        saving("bar, linear", Skip.SHAPE_FACTORS, _bar(LINEAR), _lift),
    ]


def linear_savings() -> list[Saving]:
    """Return the savings if a bar has a linear material instead of each hyperelastic material."""
    scene = _bar(LINEAR)
    linear, found = play(scene, _lift, Skip.SHAPE_FACTORS), []
    for name, material in HYPERELASTIC.items():
        other = play(_bar(material), _lift, Skip.SHAPE_FACTORS)
        found.append(_compared(f"bar, linear instead of {name}", "hyperelasticity", scene, other, linear, None))
    return found


def _compared(name: str, skip: str, scene: Scene, without: Run, found: Run, error: float | None) -> Saving:
    return Saving(
        scene=name,
        skip=skip,
        elements=scene.mesh.n_cells,
        left=int(np.median(found.left)),
        time_without=float(np.median(without.times)),
        time_with=float(np.median(found.times)),
        mean_without=float(without.times.mean()),
        mean_with=float(found.times.mean()),
        error=error,
    )


def _bar(material: Material, *, held: float = 0.0) -> Scene:
    """Return bend5's bar with 1250 elements of one material; its last fraction ``held`` is in the tip's handle."""
    mesh = bar([0.4, 0.04, 0.04], [50, 5, 5])
    x = mesh.vertices[:, 0]
    base = Handle("base", np.flatnonzero(x < 1e-9).astype(np.int32), fixed=True)
    tip = Handle("tip", np.flatnonzero(x > 0.4 * (1.0 - held) - 1e-9).astype(np.int32))
    return Scene(
        name="bar",
        mesh=mesh,
        materials={"one": material},
        cell_material=np.zeros(mesh.n_cells, np.int32),
        handles=(base, tip),
    )


def _lift(amount: float) -> Command:
    return Command(handles={"tip": Pose(translation=(-0.01 * amount**2, 0.0, 0.08 * amount))})


def saving_table(rows: Iterable[Saving]) -> str:
    """Return the savings as a Markdown table."""
    return markdown_table(HEAD, (row.row for row in rows))


def probe() -> dict[str, float]:
    """Return the figures of the first steps of the bars, and the elements left out in the last of these steps."""
    found: dict[str, float] = {}
    bars = {
        Skip.HANDLES: _bar(RUBBER, held=0.5),
        Skip.PRESSURES: _bar(NeoHookean(young=1e5, poisson=0.3)),
        Skip.SHAPE_FACTORS: _bar(LINEAR),
    }
    for skip, scene in bars.items():
        simulation = Simulation(scene)
        results = [simulation.step(_lift(step / STEPS), dt=0.01) for step in range(1, PROBED + 1)]
        found |= figures(skip.value, results, simulation)
        found[f"{skip.value}: left out"] = results[-1].skipped.get(skip.value, 0)
    return found


def main() -> None:
    """Run the measurement, print the table and write the report."""
    path = options("benchmarks.savings", "What skipped work saves.", "skip").parse_args().out
    rows = savings()
    write_report(path, {"savings": [asdict(row) for row in rows]}, probe())
    console = Console()
    console.print(saving_table(rows), soft_wrap=True, markup=False)
    console.print(f"\nwritten: {path}")


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""MuJoCo 4 flex as a peer: its implicit steps without damping are used like Newton iterations.

MuJoCo is a dynamics engine. If the full load is applied in one step and then kept, its implicit
integrator with large steps converges to the static solution like Newton's method. On bend5, the
handle's x displacement is prescribed. There is no Ogden law.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import version
from importlib.util import find_spec
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.cases import Case, CaseName, LogNeoHooke
from benchmarks.grids import Grid
from benchmarks.peers.mujoco_model import Drive, body_name, write_model
from benchmarks.peers.peer import Array, PeerError, PeerSolution, Variant, handle_reaction

TIMESTEP = 0.2
"""Time step of the integrator [s]."""
SETTLED = 3e-3
"""The load is kept until the mean motion of the nodes in a step is below this fraction of their mean displacement."""
_MAXIMUM_HOLD = 100

_CELLS = {
    CaseName.BEND5: (
        (1, (10, 1, 1)),
        (1, (15, 1, 1)),
        (1, (30, 2, 2)),
        (1, (40, 3, 3)),
        (1, (50, 5, 5)),
        (2, (10, 1, 1)),
        (2, (20, 1, 1)),
    ),
    CaseName.TWIST90_UNIFORM: (
        (1, (12, 3, 3)),
        (1, (14, 4, 4)),
        (1, (20, 5, 5)),
        (2, (6, 2, 2)),
        (2, (8, 2, 2)),
    ),
}
_STREAM_STEPS = {CaseName.BEND5: 200, CaseName.TWIST90_UNIFORM: 100}
_ELEMENTS = {1: "trilinear", 2: "quadratic"}


def available() -> str | None:
    """Return None if MuJoCo is installed, else the reason and the remedy."""
    return None if find_spec("mujoco") else "not installed: mujoco; pip install 'mujoco>=4'"


def variants(case: Case) -> tuple[Variant, ...]:
    """Return the variants: flexes of both orders, in one load step and as streams; none for scenes with Ogden laws."""
    if not all(isinstance(law, LogNeoHooke) for law in case.laws):
        return ()
    drive = Drive.HEAVY if case.name is CaseName.BEND5 else Drive.MOCAP
    jumps = [_variant(order, cells, drive) for order, cells in _CELLS[case.name]]
    steps = _STREAM_STEPS[case.name]
    return (*jumps, *(_variant(order, cells, Drive.HEAVY, steps=steps) for order, cells in _CELLS[case.name]))


def _variant(order: int, cells: tuple[int, int, int], drive: Drive, *, steps: int = 1) -> Variant:
    label = f"{_ELEMENTS[order]} {'x'.join(map(str, cells))}"
    return Variant(
        label=label if steps == 1 else f"{label}, {steps} steps",
        element=_ELEMENTS[order],
        cells=cells,
        steps=steps,
        options={"drive": drive.value, "stream": steps > 1},
    )


@dataclass
class Bar:
    """A compiled bar and its state.

    Attributes:
        case: scene.
        grid: lattice of nodes.
        drive: method by which the right face is moved.
        model: MuJoCo's model.
        data: MuJoCo's state.
        free: ids of lattice nodes with degrees of freedom, shape (f,).
        dofs: their degrees of freedom, shape (f, 3).
        handle: ids of the right face's nodes.
        handles: their degrees of freedom (k, 3), or mocap ids (k,).
    """

    case: Case
    grid: Grid
    drive: Drive
    model: Any
    data: Any
    free: npt.NDArray[np.int64]
    dofs: npt.NDArray[np.int64]
    handle: npt.NDArray[np.int32]
    handles: npt.NDArray[np.int64]

    def advance(self, load: float) -> None:
        """Make one step towards the handle's position at the load fraction ``load``."""
        import mujoco

        rest = self.grid.points()[self.handle]
        target = self.case.handle_displacement(rest, load=load)
        if self.drive is Drive.MOCAP:
            self.data.mocap_pos[self.handles] = rest + target
            mujoco.mj_step(self.model, self.data)
            return
        self.data.qvel[self.handles] = (target - self.data.qpos[self.handles]) / TIMESTEP
        mujoco.mj_step(self.model, self.data)
        self.data.qpos[self.handles] = target

    def displacement(self, load: float) -> Array:
        """Return the displacements of all lattice nodes, shape (n, 3), float64 [m]."""
        result = np.zeros((len(self.grid.points()), 3))
        result[self.free] = self.data.qpos[self.dofs]
        result[self.handle] = self.case.handle_displacement(self.grid.points()[self.handle], load=load)
        return result


def compile_bar(case: Case, grid: Grid, drive: Drive) -> Bar:
    """Compile the MJCF model of a bar."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(write_model(case.laws, grid, drive, timestep=TIMESTEP))
    handle, left = grid.face(right=True), grid.face(right=False)
    held = left if drive is Drive.HEAVY else np.concatenate([left, handle])
    free = np.setdiff1d(np.arange(len(grid.points())), held)
    bodies = np.array([model.body(body_name(int(node))).id for node in free])
    dofs = model.body_dofadr[bodies][:, None] + np.arange(3)
    if drive is Drive.MOCAP:
        handles = np.array([model.body_mocapid[model.body(body_name(int(node))).id] for node in handle])
    else:
        handles = dofs[np.searchsorted(free, handle)]
    data = mujoco.MjData(model)
    return Bar(case, grid, drive, model, data, free, dofs.astype(np.int64), handle, handles.astype(np.int64))


def solve(case: Case, variant: Variant, points: Array) -> PeerSolution:
    """Compile a bar, drive it and evaluate it; see `Peer.solve`.

    With the option ``stream``, the time of the solution is that of all steps.

    Raises:
        PeerError: if the bar does not come to equilibrium or MuJoCo reports an unusable state.
    """
    drive, order = Drive(variant.options["drive"]), 2 if variant.element == "quadratic" else 1
    stream = bool(variant.options.get("stream", False))
    start = perf_counter()
    grid = case.grid(variant.cells, order=order)
    bar = compile_bar(case, grid, drive)
    built = perf_counter()
    made = _stream(bar, variant.steps) if stream else _settle(bar, variant.steps)
    solved = perf_counter()
    displacement = bar.displacement(1.0)
    warned = _warnings(bar, f"mujoco {case.name.value} {variant.label}")
    settings: dict[str, Any] = {
        "version": version("mujoco"),
        "law": "corotated linear elasticity",
        "drive": drive.value,
        "timestep": TIMESTEP,
        "settled": SETTLED,
        "integrator_steps": made,
        "prescribed_x": case.slide if case.slides else None,
        "warnings": warned,
    }
    return PeerSolution(
        displacement=grid.evaluate(displacement, points),
        reaction=_reaction(case, grid, displacement),
        time_setup=built - start,
        time_solve=solved - built,
        settings=settings,
    )


def _settle(bar: Bar, steps: int) -> int:
    """Apply the load in ``steps`` steps, and keep it until the bar is `SETTLED`; return the number of all steps."""
    before = bar.displacement(0.0)
    for step in range(1, steps + _MAXIMUM_HOLD):
        load = min(1.0, step / steps)
        bar.advance(load)
        now = bar.displacement(load)
        moved = np.linalg.norm(now - before, axis=1).mean()
        if load == 1.0 and moved < SETTLED * np.linalg.norm(now, axis=1).mean():
            return step
        before = now
    raise PeerError(f"mujoco {bar.case.name.value}: the bar has not settled after {_MAXIMUM_HOLD} steps of hold")


def _stream(bar: Bar, steps: int) -> int:
    """Make one integrator step for each of ``steps`` equal load steps; return their number."""
    for step in range(1, steps + 1):
        bar.advance(step / steps)
    return steps


def _warnings(bar: Bar, where: str) -> list[str]:
    import mujoco

    counts = {kind.name: int(bar.data.warning[int(kind)].number) for kind in _warning_kinds(mujoco)}
    bad = [name for name in ("mjWARN_BADQPOS", "mjWARN_BADQVEL", "mjWARN_BADQACC") if counts[name]]
    if bad or not np.isfinite(bar.data.qpos).all():
        raise PeerError(f"{where}: the state became unusable ({', '.join(bad) or 'not finite'})")
    return [f"{name} in {count} steps" for name, count in counts.items() if count]


def _warning_kinds(mujoco: Any) -> list[Any]:
    members = mujoco.mjtWarning.__members__
    return [kind for name, kind in members.items() if name != "mjNWARNING"]


def _reaction(case: Case, grid: Grid, displacement: Array) -> Array:
    """Return the wrench (6,) of a handle with degrees of freedom, from the elastic forces of the bar [N], [N m]."""
    import mujoco

    bar = compile_bar(case, grid, Drive.HEAVY)
    bar.data.qpos[bar.dofs] = displacement[bar.free]
    mujoco.mj_forward(bar.model, bar.data)
    forces = np.zeros_like(displacement)
    forces[bar.free] = -bar.data.qfrc_spring[bar.dofs]
    return handle_reaction(grid, displacement, forces)

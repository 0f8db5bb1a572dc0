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

from benchmarks.cases import Case
from benchmarks.grids import Grid
from benchmarks.peers.mujoco_model import Drive, body_name, write_model
from benchmarks.peers.peer import Array, PeerError, PeerSolution, Variant, handle_reaction

TIMESTEP = 0.2
"""Time step of the integrator [s]."""
SETTLED = 3e-3
"""The load is kept until the mean motion of the nodes in a step is below this fraction of their mean displacement."""
_MAXIMUM_HOLD = 100
_BAD = "mjWARN_BADQPOS", "mjWARN_BADQVEL", "mjWARN_BADQACC"


def available() -> str | None:
    """Return None if MuJoCo is installed, else the reason and the remedy."""
    return None if find_spec("mujoco") else "not installed: mujoco; pip install 'mujoco>=4'"


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


def load_lattice(text: str, grid: Grid, held: npt.NDArray[np.int32]) -> tuple[Any, Any, Array, Array]:
    """Return MuJoCo's model and state of an MJCF text, its nodes (f,) that are not ``held``, and their dofs (f, 3)."""
    import mujoco

    # It would print and log, in every run, that the solve before that of the whole system did not converge.
    mujoco.set_mju_user_warning(lambda _: None)
    model = mujoco.MjModel.from_xml_string(text)
    free = np.setdiff1d(np.arange(len(grid.points())), held)
    bodies = np.array([model.body(body_name(int(node))).id for node in free])
    return model, mujoco.MjData(model), free, model.body_dofadr[bodies][:, None] + np.arange(3)


def require_usable(data: Any, where: str) -> None:
    """Raise an error if MuJoCo calls a state unusable, or it is not finite.

    Raises:
        PeerError: the state is unusable; ``where`` are words about the run.
    """
    import mujoco

    kinds = mujoco.mjtWarning.__members__
    bad = [name for name in _BAD if data.warning[int(kinds[name])].number]
    if bad or not np.isfinite(data.qpos).all():
        raise PeerError(f"{where}: the state became unusable ({', '.join(bad) or 'not finite'})")


def compile_bar(case: Case, grid: Grid, drive: Drive) -> Bar:
    """Compile the MJCF model of a bar."""
    handle, left = grid.face(right=True), grid.face(right=False)
    held = left if drive is Drive.HEAVY else np.concatenate([left, handle])
    model, data, free, dofs = load_lattice(write_model(case.laws, grid, drive, timestep=TIMESTEP), grid, held)
    if drive is Drive.MOCAP:
        handles = np.array([model.body_mocapid[model.body(body_name(int(node))).id] for node in handle])
    else:
        handles = dofs[np.searchsorted(free, handle)]
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

    require_usable(bar.data, where)
    kinds = [kind for name, kind in mujoco.mjtWarning.__members__.items() if name != "mjNWARNING"]
    counts = {kind.name: int(bar.data.warning[int(kind)].number) for kind in kinds}
    return [f"{name} in {count} steps" for name, count in counts.items() if count]


def _reaction(case: Case, grid: Grid, displacement: Array) -> Array:
    """Return the wrench (6,) of a handle with degrees of freedom, from the elastic forces of the bar [N], [N m]."""
    import mujoco

    bar = compile_bar(case, grid, Drive.HEAVY)
    bar.data.qpos[bar.dofs] = displacement[bar.free]
    mujoco.mj_forward(bar.model, bar.data)
    forces = np.zeros_like(displacement)
    forces[bar.free] = -bar.data.qfrc_spring[bar.dofs]
    return handle_reaction(grid, displacement, forces)

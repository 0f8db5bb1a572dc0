# SPDX-License-Identifier: Apache-2.0
"""A box between two soft pads in MuJoCo 4 flex.

These are the best settings of several trials: the integrator ``discrete`` (the only one that is implicit for flexes),
elliptic cones, Newton's method, ``impratio`` 100. With ``impratio`` 1000, harder contacts (``solimp`` up to 0.9999) or
steps of 1 and 2 ms, the box creeps as fast. ``noslip_iterations`` are not available for flexes. MuJoCo warns in every
step that its solve before contacts is under-converged, with and without equalities that make it factor the whole
system.
"""

from __future__ import annotations

import numpy as np

from benchmarks.peers.grip_case import (
    BOX,
    BOX_DENSITY,
    CELLS,
    DENSITY,
    GRAVITY,
    PAD,
    POISSON,
    SPAN,
    SQUEEZE,
    STAGES,
    STEP,
    WEIGHT,
    YOUNG,
)
from benchmarks.peers.mujoco_peer import available, require_usable

__all__ = ["available", "simulate"]

LIKELY_PRESS = 7.0
"""Estimated normal force of a pad [N], from which the friction of the first run is chosen."""


def simulate(demand: float, *, seconds: float) -> dict[str, float]:
    """Squeeze, load and hold the box with ``demand`` times the least friction that holds it.

    The least friction follows from the normal force of the pads in a first run with sufficient friction.

    Returns:
        ``press`` [N], ``sunk`` [m] and ``drift`` [m], as in `benchmarks.contact.grip`.

    Raises:
        PeerError: the state became unusable.
    """
    press = _Grip(46.0 * WEIGHT / (2.0 * LIKELY_PRESS)).loaded()
    grip = _Grip(demand * WEIGHT / (2.0 * press))
    press = grip.loaded()
    start = grip.height
    grip.go("hold", seconds)
    return {"press": press, "sunk": -start, "drift": start - grip.height}


class _Grip:
    """The scene with one friction coefficient."""

    def __init__(self, friction: float) -> None:
        import mujoco

        mujoco.set_mju_user_warning(lambda _: None)
        self._mujoco, self._friction = mujoco, friction
        self._model = mujoco.MjModel.from_xml_string(model_text(friction))
        self._data = mujoco.MjData(self._model)
        joints = [self._model.joint(name) for name in ("left", "right")]
        self._places, self._speeds = [j.qposadr[0] for j in joints], [j.dofadr[0] for j in joints]
        self._box = self._model.joint("part").qposadr[0]

    @property
    def height(self) -> float:
        """Height of the box [m]."""
        return float(self._data.qpos[self._box + 2])

    def loaded(self) -> float:
        """Simulate all stages; return the normal force of a pad [N]."""
        for stage, lasts in STAGES:
            self.go(stage, lasts)
        self._mujoco.mj_forward(self._model, self._data)
        force, total = np.zeros(6), 0.0
        for contact in range(self._data.ncon):
            self._mujoco.mj_contactForce(self._model, self._data, contact, force)
            total += 0.5 * float(force[0])
        return total

    def go(self, stage: str, lasts: float) -> None:
        """Make the steps of a ``stage`` of duration ``lasts`` [s]."""
        count = round(lasts / STEP)
        for done in range(1, count + 1):
            share = done / count
            way = SQUEEZE * (share if stage == "squeeze" else 1.0)
            weighs = {"squeeze": 0.0, "settle": 0.0, "load": share}.get(stage, 1.0)
            self._model.opt.gravity[2] = -GRAVITY * weighs
            for sign, place, speed in zip((1.0, -1.0), self._places, self._speeds, strict=True):
                self._data.qpos[place] = sign * way
                self._data.qvel[speed] = sign * SQUEEZE / lasts if stage == "squeeze" else 0.0
            self._mujoco.mj_step(self._model, self._data)
        require_usable(self._data, f"mujoco grip, friction {self._friction:g}, {stage}")


def model_text(friction: float) -> str:
    """Return the MJCF text of the scene."""
    counts = [cells + 1 for cells in CELLS]
    spacing = " ".join(f"{length / cells:.9g}" for length, cells in zip(PAD, CELLS, strict=True))
    contact = f'condim="3" friction="{friction:.9g} 0.005 0.0001" solref="0.005 1" solimp="0.95 0.99 0.001"'
    pads = []
    for name, place, outer in (("left", 0.5 * PAD[0], 0), ("right", SPAN - 0.5 * PAD[0], counts[0] - 1)):
        pads.append(
            f'<body name="{name}" pos="{place:.9g} 0 0"><joint name="{name}" type="slide" axis="1 0 0"/>'
            '<inertial pos="0 0 0" mass="10" diaginertia="1 1 1"/>'
            f'<flexcomp name="pad_{name}" type="grid" dim="3" count="{" ".join(map(str, counts))}" '
            f'spacing="{spacing}" radius="0.0005" mass="{DENSITY * float(np.prod(PAD)):.9g}">'
            f'<edge equality="false"/><elasticity young="{YOUNG:g}" poisson="{POISSON:g}" damping="0.001"/>'
            f'<contact selfcollide="none" {contact}/>'
            f'<pin gridrange="{outer} 0 0 {outer} {counts[1] - 1} {counts[2] - 1}"/></flexcomp></body>'
        )
    half = " ".join(f"{0.5 * length:.9g}" for length in BOX)
    box = (
        f'<body name="part" pos="{0.5 * SPAN:.9g} 0 0"><freejoint name="part"/>'
        f'<geom type="box" size="{half}" density="{BOX_DENSITY:g}" {contact}/></body>'
    )
    option = (
        f'<option timestep="{STEP:g}" integrator="discrete" cone="elliptic" solver="Newton" iterations="100" '
        'tolerance="1e-12" impratio="100"/>'
    )
    return f"<mujoco>{option}<worldbody>{''.join(pads)}{box}</worldbody></mujoco>"

# SPDX-License-Identifier: Apache-2.0
"""The whole changing state of a simulated body, as one immutable value.

No array or mapping of a state is ever modified. A copy is a reference, two simulations can share a state, and a step
returns a new one. All other data are constants or work arrays, and no result depends on old contents of work arrays.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.actuator import ActuatorState
from gdfe_ros.constraints import Pose
from gdfe_ros.solver.account import Ledger
from gdfe_ros.solver.descent.history import UpdateHistory
from gdfe_ros.solver.elements.operators import Operators
from gdfe_ros.solver.tangent.tangent import Tangent
from gdfe_ros.solver.value import changed

Array = NDArray[np.float64]
Saved = Mapping[str, NDArray[np.float64]]
"""State that a term stores from one accepted step to the next, arrays by name; an immutable value."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ElementState:
    """State of the elements under the policy ``energy``.

    Attributes:
        pressures, pressures_before: (m,) p_e [Pa], positive in tension, of the last two accepted solves.
        bulk: (k,) penalty bulk modulus of elements with pressures, by material [Pa]; raised if pressures oscillate.
        hourglass_scale: (m,) hourglass stiffness over the initial one.
    """

    pressures: Array
    pressures_before: Array
    bulk: Array
    hourglass_scale: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class ShapeState:
    """State of the elements under the policy ``relative``.

    Attributes:
        captured: (m, 8, 3) volume-conserving shapes of the last converged solve [m], in the elements' own frames and
            with growth divided out.
        strain: (m,) equivalent strains at that solve.
        omega: (m,) shape factors of the last solve.
    """

    captured: Array
    strain: Array
    omega: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class Motion:
    """The last accepted step, for the predictor.

    Attributes:
        move: (n, 3) displacements of all vertices [m].
        base: (b, 3) commanded displacements of the handles' vertices [m].
        change: (c,) changes of the commands of actuators and loads, each in its own unit.
        slides, turns: (p, 3) changes of the handles' free translations [m] and rotation vectors [rad].
    """

    move: Array
    base: Array
    change: Array
    slides: Array
    turns: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class DormancyState:
    """Dormancy state: the part of the body that is frozen because it is at rest; see `Dormancy`.

    Attributes:
        awake: (n,) vertices that the present part moves; None if the whole body moves.
        known: forces and energies of the frozen elements; None if they are still to be evaluated.
        border: (k, 3) dE/dx [N] of the watched vertices when ``known`` was evaluated; None without it.
        yielding: displacement [m] of the frozen vertices per 1 N of change of the border's forces, as last computed;
            infinite before the first computation.
        before: (n, 3) positions [m] of the last step that was examined; the undeformed ones before the first.
        calm: (n,) vertices at rest since counting began.
        count: steps counted.
        patience: number of successive steps for which a vertex must be at rest before it is frozen.
        rests, longer_rest: number of steps to skip before the next examination, and the last number of skipped steps,
            doubled each time.
        lasted: steps since the present part was chosen.
    """

    awake: NDArray[np.bool_] | None
    known: Known | None
    border: Array | None
    yielding: float
    before: Array | None
    calm: NDArray[np.bool_]
    count: int
    patience: int
    rests: int
    longer_rest: int
    lasted: int


@dataclass(frozen=True, eq=False, kw_only=True)
class Known:
    """Forces and energies of the elements at the positions at which a part of them was frozen.

    Attributes:
        force: (m, c, 3) corner forces [N].
        energies, stored: (m,) energies [J] as the kernels count them, and with the full volume energy.
        least: (m,) least volume ratio at a corner.
    """

    force: Array
    energies: Array
    stored: Array
    least: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class SoftDirection:
    """The softest direction of a stable equilibrium, along which it may first become a saddle.

    Attributes:
        direction: (3 r,) of the unknowns.
        asked, looked: iterations since the energy's curvature along it was evaluated, and since it was computed.
    """

    direction: Array
    asked: int
    looked: int

    def after(self, iterations: int) -> SoftDirection:
        """Return the direction with both counts increased by ``iterations``."""
        return changed(self, asked=self.asked + iterations, looked=self.looked + iterations)


@dataclass(frozen=True, eq=False, kw_only=True)
class Unfinished:
    """Progress of a solve that was cut, from which the next one continues.

    Attributes:
        tolerance: tolerance of the cut minimisation.
        iterations: number of iterations since the last finished solve.
        recent: (2 WINDOW,) displacements [m] of the last steps, as a ring buffer.
        seen: number of steps recorded.
    """

    tolerance: float
    iterations: int
    recent: Array
    seen: int


@dataclass(frozen=True, eq=False, kw_only=True)
class Balance:
    """Energy data of an equilibrium from which the work of the next increment is computed.

    Attributes:
        potential: of all terms other than the elements [J]; zero while undeformed, and for commanded lengths and
            volumes.
        slopes: d(energy + potential)/d(command) by actuator and load.
    """

    potential: float
    slopes: Mapping[str, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class Summary:
    """Quality and results of the last accepted solve.

    Attributes:
        converged: whether it is an equilibrium to the tolerance.
        error_estimate: estimated largest distance to the equilibrium over the body's size; infinite if it is unknown.
        energy: strain energy [J].
        min_det: least volume ratio at a corner of an element.
        reactions: by handle (6,), as in `StepResult`.
        actuators: by name.
        terms: reports of further terms by name.
        message: the defect; empty if there is none.
        stable: as in `StepResult`.
    """

    converged: bool
    error_estimate: float
    energy: float
    min_det: float
    reactions: Mapping[str, Array]
    actuators: Mapping[str, ActuatorState] = field(default_factory=dict)
    terms: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    message: str = ""
    stable: bool | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class State:
    """A body in the middle of a simulation.

    Attributes:
        positions: (n, 3) [m].
        base: (n, 3) [m]. The rows of handle vertices are the commanded positions.
        poses: commanded, by handle.
        commands: of actuators and loads, by name, in the unit of each mode.
        slides, turns: (p, 3) free translations [m] and rotation vectors [rad] of the handles with a free axis.
        orientation: (p, 3, 3) rotations of these handles at their last coupling to the constant matrix.
        motion: the last step; None before the first.
        terms: stored state of each term.
        elements, shapes: state of the elements under the policies ``energy`` and ``relative``.
        operators: of the elements at the present growth.
        history, part_history: quasi-Newton histories of the whole body, and of the awake part.
        tangent: the tangent that preconditions the minimisation; None for the constant matrix.
        sleep: dormancy state.
        unfinished: progress of the last solve if it was cut; None if it was not.
        soft: softest direction; None if none was computed.
        balance: energy balance of the equilibrium; None if this state is no equilibrium, or has no energy.
        summary: of the last accepted solve.
        sound: whether no element is folded or inverted.
        suspect: whether the positions were given and have folded or inverted elements.
        tried: whether the load path from rest was tried without success.
        anchor: None if this state is an equilibrium. After a cut solve, or a failed step with crumpled elements: the
            last equilibrium.
        ledger: energy account of a moving body; None without dynamics.
    """

    positions: Array
    base: Array
    poses: Mapping[str, Pose]
    commands: Mapping[str, float]
    slides: Array
    turns: Array
    orientation: Array
    motion: Motion | None = None
    terms: Mapping[str, Saved]
    elements: ElementState | None = None
    shapes: ShapeState | None = None
    operators: Operators
    history: UpdateHistory = field(default_factory=UpdateHistory.empty)
    part_history: UpdateHistory = field(default_factory=UpdateHistory.empty)
    tangent: Tangent | None = None
    sleep: DormancyState | None = None
    unfinished: Unfinished | None = None
    soft: SoftDirection | None = None
    balance: Balance | None
    summary: Summary
    sound: bool = True
    suspect: bool = False
    tried: bool = False
    anchor: State | None = None
    ledger: Ledger | None = None

    def change_to(self, commands: Mapping[str, float]) -> Array:
        """Return the changes (c,) from the present commands to ``commands``, each in its own unit."""
        return np.array([commands[name] - value for name, value in self.commands.items()])

    @property
    def dissipated(self) -> float:
        """Energy that the terms have dissipated so far [J]: the sum of their ``lost``."""
        return sum(float(saved["lost"][0]) for saved in self.terms.values() if "lost" in saved)

    def with_(self, **changes: object) -> State:
        """Return a copy of the state with the named attributes replaced.

        Raises:
            TypeError: there is no such attribute.
        """
        return changed(self, **changes)


@dataclass(frozen=True, eq=False, kw_only=True)
class Snapshot:
    """A simulation in the middle of a run.

    Attributes:
        state: of the body.
        time: simulation time [s].
        targets, commands: poses by handle; values by actuator and load, before rate limits.
        scene: text of its scene, policy and torsion.
        joints: by arm, goals, positions, velocities and accelerations of its joints.
    """

    state: State
    time: float
    targets: Mapping[str, Pose]
    commands: Mapping[str, float]
    scene: str = ""
    joints: Mapping[str, tuple[NDArray[np.float64], ...]] = field(default_factory=dict)

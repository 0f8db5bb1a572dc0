# SPDX-License-Identifier: Apache-2.0
"""The state of a simulated body, with the energy account of its motion, as one immutable value.

No array or mapping of a state is ever modified. A reference therefore serves as a copy, two simulations can share a
state, and a step returns a new state. All other data of the solver are constants or work arrays, and no result depends
on the earlier contents of a work array.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from gdfe_ros.actuators.actuator import ActuatorState
from gdfe_ros.constraints import Pose
from gdfe_ros.solver.elements.blocks import Operators
from gdfe_ros.solver.matrix.tangent_assembly import Tangent
from gdfe_ros.solver.vectors import Array

Value = TypeVar("Value")


def replace_fields(value: Value, **changes: object) -> Value:
    """Return a copy of a frozen dataclass with the named attributes replaced.

    ``__post_init__`` is not called again. `dataclasses.replace` takes ten times as long, which is a tenth of the time
    of a small body's step.

    Raises:
        TypeError: there is no such attribute.
    """
    copy = object.__new__(type(value))
    copy.__dict__.update(value.__dict__, **changes)
    if len(copy.__dict__) != len(value.__dict__):
        unknown = changes.keys() - value.__dict__.keys()
        raise TypeError(f"a {type(value).__name__} has no {', '.join(sorted(unknown))}")
    return copy


@dataclass(frozen=True, eq=False, kw_only=True)
class Failure:
    """Record of a time step whose first internal step fails from the present state, even at the shortest length.

    Attributes:
        poses, commands: targets of the step.
        duration: duration of the step [s].
        length: length of its internal steps [s] before any of them is halved.
        reason: reason for the failure.
    """

    poses: Mapping[str, Pose]
    commands: Mapping[str, float]
    duration: float
    length: float
    reason: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Bound:
    """Extremes of a moving body's energy; they show whether a step creates energy.

    Attributes:
        start: kinetic + elastic + potential energy - work [J] at the beginning.
        least: minimum of kinetic + elastic + potential energy - work so far [J]. The uncertainty of later work is added
            to ``start`` and ``least``.
        most: largest kinetic + elastic energy so far [J].
    """

    start: float
    least: float
    most: float

    def allow(self, energy: float) -> Bound:
        """Return extremes that allow an additional energy [J]."""
        return replace_fields(self, start=self.start + energy, least=self.least + energy)


@dataclass(frozen=True, eq=False, kw_only=True)
class Ledger:
    """Work and dissipated energy of a moving body since the start, and time that is not simulated yet.

    Attributes:
        work: work of handles and of changing commands on the body [J].
        lost: energy dissipated by damping and friction [J].
        owed: time [s] that is reported, but was too short to simulate; the next step includes it.
        failure: the last step if it failed; None if it succeeded.
        bound: extremes of the energy; None if the next step starts them anew.
    """

    work: float
    lost: float
    owed: float = 0.0
    failure: Failure | None = None
    bound: Bound | None = None


Saved = Mapping[str, Array]
"""State of a term between two accepted steps: a dict from name to array, never modified."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ElementState:
    """State of the elements under the policy ``energy``.

    Attributes:
        pressures: (m,) pressures p_e [Pa] of the last accepted solve, positive in tension.
        pressures_before: (m,) pressures p_e [Pa] of the accepted solve before the last one.
        bulk: (k,) penalty bulk modulus [Pa] of each material, for elements with pressures; raised if pressures
            oscillate.
        hourglass_scale: (m,) present hourglass stiffness divided by the initial one.
        hourglass_scale_before: (m,) hourglass scale after the accepted solve before the last one.
    """

    pressures: Array
    pressures_before: Array
    bulk: Array
    hourglass_scale: Array
    hourglass_scale_before: Array


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
    """Changes of the last accepted step, which the predictor extrapolates.

    Attributes:
        move: (n, 3) displacements of all vertices [m].
        base: (b, 3) commanded displacements of the handles' vertices [m].
        change: (c,) changes of the commands of actuators and loads, each in its own unit.
        slides, turns: (p, 3) changes of the handles' free translations [m] and free rotation vectors [rad].
    """

    move: Array
    base: Array
    change: Array
    slides: Array
    turns: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class Unfinished:
    """Progress of a solve that the limit or the deadline ended; the next solve continues from it.

    Attributes:
        tolerance: tolerance of the unfinished minimisation.
        iterations: number of iterations since the last finished solve.
        steps, changes: (k, 3 r) [m] and [N] pairs of the L-BFGS history, oldest first.
    """

    tolerance: float
    iterations: int
    steps: Array
    changes: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class Balance:
    """Energy data of an equilibrium from which the work of the next increment is computed.

    Attributes:
        potential: potential of all terms other than the elements [J]. It is zero for the undeformed body. Lengths and
            volumes that multipliers keep contribute nothing.
        slopes: dict from actuator or load name to d(energy + potential)/d(command).
    """

    potential: float
    slopes: Mapping[str, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class Summary:
    """Quality and results of the last accepted solve.

    Attributes:
        converged: whether the positions are an equilibrium to the tolerance.
        error_estimate: estimated largest distance to the equilibrium, divided by the body's size; infinite if it is
            unknown.
        energy: strain energy [J].
        min_det: least volume ratio det F at a corner of an element.
        reactions: dict from handle or obstacle name to wrench (6,), as in `StepResult`.
        actuators: dict from actuator name to its state.
        terms: dict from the name of a further term to its report.
        message: description of the defect; empty if there is none.
        stable, estimated: as in `StepResult`.
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
    estimated: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class State:
    """State of a body during a simulation.

    Attributes:
        positions: (n, 3) vertex positions [m].
        base: (n, 3) [m]; rows of handle vertices are their commanded positions, other rows are not used.
        poses: dict from handle or obstacle name to commanded pose.
        commands: dict from actuator or load name to command, in the unit of its mode.
        slides, turns: (p, 3) free translations [m] and free rotation vectors [rad] of the handles with a free axis.
        motion: changes of the last step; None before the first step.
        terms: dict from term name to its stored state.
        elements, shapes: state of the elements under the policies ``energy`` and ``relative``.
        operators: operators of the elements at the present growth.
        tangent: the tangent that preconditions the minimisation; None stands for that of the undeformed body.
        unfinished: progress of the last solve if the limit or the deadline ended it; otherwise None.
        proved: strain energy [J] of the last equilibrium whose stability was examined; None if none was.
        balance: energy balance of the equilibrium; None if this state is no equilibrium, or has no energy.
        summary: quality and results of the last accepted solve.
        sound: whether no element is folded or inverted.
        suspect: whether a user has set positions with folded or inverted elements.
        anchor: the last equilibrium, from which a step may be tried again. It is set if the limit or the deadline ended
            the solve, or if a load path failed with elements folded or nearly folded; otherwise None.
        ledger: energy account of a moving body; None without dynamics.
    """

    positions: Array
    base: Array
    poses: Mapping[str, Pose]
    commands: Mapping[str, float]
    slides: Array
    turns: Array
    motion: Motion | None = None
    terms: Mapping[str, Saved]
    elements: ElementState | None = None
    shapes: ShapeState | None = None
    operators: Operators
    tangent: Tangent | None = None
    unfinished: Unfinished | None = None
    proved: float | None = None
    balance: Balance | None
    summary: Summary
    sound: bool = True
    suspect: bool = False
    anchor: State | None = None
    ledger: Ledger | None = None

    def change_to(self, commands: Mapping[str, float]) -> Array:
        """Return the changes (c,) from the present commands to ``commands``, each in its own unit."""
        return np.array([commands[name] - value for name, value in self.commands.items()])

    @property
    def dissipated(self) -> float:
        """Energy that the terms have dissipated so far [J]: the sum of their ``lost``."""
        return sum(float(saved["lost"][0]) for saved in self.terms.values() if "lost" in saved)

    def with_flaw(self, message: str, **changes: object) -> State:
        """Return a copy of the state that is not converged, with a message and other changes of the summary."""
        return replace_fields(self, summary=replace_fields(self.summary, converged=False, message=message, **changes))

    def with_(self, **changes: object) -> State:
        """Return a copy of the state with the named attributes replaced.

        Raises:
            TypeError: there is no such attribute.
        """
        return replace_fields(self, **changes)


@dataclass(frozen=True, eq=False, kw_only=True)
class Snapshot:
    """State of a simulation during a run.

    Attributes:
        state: state of the body.
        time: simulation time [s].
        targets: dict from handle or obstacle name to commanded pose.
        commands: dict from actuator or load name to commanded value, before rate limits.
        scene: text of the scene, policy and torsion.
        joints: dict from arm name to goals, positions, velocities and accelerations of its joints.
        links: dict from arm name to the motion of its yielding joints on the side of the links, as in
            `gdfe_ros.coupling.link_motion.LinkMotion`.
    """

    state: State
    time: float
    targets: Mapping[str, Pose]
    commands: Mapping[str, float]
    scene: str = ""
    joints: Mapping[str, tuple[Array, ...]] = field(default_factory=dict)
    links: Mapping[str, tuple[Array, ...]] = field(default_factory=dict)

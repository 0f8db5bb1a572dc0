# SPDX-License-Identifier: Apache-2.0
"""Everything that changes while a body is simulated, as one value.

No array of a state is ever written again, nor is any of its mappings: a copy is a reference, two simulations can share
one, and what a step finds is a new state. What is not in here is constant, or a workspace whose contents no result
depends on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.actuator import ActuatorState
from gdfe_ros.constraints import Pose
from gdfe_ros.solver.account import Ledger
from gdfe_ros.solver.descent.history import History
from gdfe_ros.solver.elements.operators import Operators
from gdfe_ros.solver.tangent.level import Tangent
from gdfe_ros.solver.terms.term import Saved
from gdfe_ros.solver.value import changed

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class ElementState:
    """What elements remember under the policy ``energy``.

    Attributes:
        pressures, pressures_before: (m,) p_e [Pa], positive in tension, of the last two accepted solves.
        bulk: (k,) bulk modulus beside the pressures by material [Pa]; raised where pressures swing.
        hourglass_scale: (m,) hourglass stiffness over that at rest.
    """

    pressures: Array
    pressures_before: Array
    bulk: Array
    hourglass_scale: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class ShapeState:
    """What elements remember under the policy ``relative``.

    Attributes:
        captured: (m, 8, 3) volume-conserving shapes of the last converged solve in the elements' own frames, taken
            back to no growth [m].
        strain: (m,) equivalent strains there.
        omega: (m,) shape factors of the last solve.
    """

    captured: Array
    strain: Array
    omega: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class Motion:
    """The last accepted step, as the predictor needs it.

    Attributes:
        move: (n, 3) of all vertices [m].
        base: (b, 3) of the handles' vertices as commanded [m].
        change: (c,) of the commands of actuators and loads, each in its own unit.
        slides, turns: (p, 3) of the handles' free translations [m] and rotation vectors [rad].
    """

    move: Array
    base: Array
    change: Array
    slides: Array
    turns: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class Sleep:
    """How much of a body is held for being at rest; see `Dormancy`.

    Attributes:
        awake: (n,) vertices that the part in force moves; None where the whole body moves.
        known: forces and energies of the held elements; None where they are still to be evaluated.
        border: (k, 3) dE/dx [N] of the watched vertices when the part was taken; None without ``known``.
        yielding: displacement [m] of the held vertices by a border force of 1 N, as last found; infinite: not yet.
        before: (n, 3) positions [m] of the last step that was looked at; None where nothing is ever held.
        calm: (n,) vertices at rest since counting began.
        count: steps counted.
        patience: steps in a row for which a vertex must be at rest.
        rests, longer_rest: steps in which nobody looks, now and next time.
        lasted: steps that the part has lasted.
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
    """The elements at the positions from which on a part of them is held.

    Attributes:
        force: (m, 8, 3) corner forces [N].
        energies, stored: (m,) energies [J] as the kernels count them, and with the full volume energy.
        least: (m,) least volume ratio at a corner.
    """

    force: Array
    energies: Array
    stored: Array
    least: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class SoftDirection:
    """The direction in which a stable equilibrium was softest: the first along which it may become a saddle.

    Attributes:
        direction: (3 r,) of the unknowns.
        asked, looked: iterations since the energy's curvature along it was evaluated, and since it was found.
    """

    direction: Array
    asked: int
    looked: int

    def after(self, iterations: int) -> SoftDirection:
        """Return it so many iterations later."""
        return changed(self, asked=self.asked + iterations, looked=self.looked + iterations)


@dataclass(frozen=True, eq=False, kw_only=True)
class Unfinished:
    """Where a solve was cut, so that the next one goes on from there.

    Attributes:
        tolerance: of the descent that was cut.
        iterations: that were made since the last solve that was finished.
        recent: (2 WINDOW,) displacements [m] of the last steps, in a ring.
        seen: how many steps were seen.
    """

    tolerance: float
    iterations: int
    recent: Array
    seen: int


@dataclass(frozen=True, eq=False, kw_only=True)
class Balance:
    """What an equilibrium would give for a motion of its commands.

    Attributes:
        potential: of all that acts beside the elements [J]; zero at rest and where a length or a volume is commanded.
        slopes: d(energy + potential)/d(command) by actuator and load.
    """

    potential: float
    slopes: Mapping[str, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class Summary:
    """How good the last accepted solve was and what it found.

    Attributes:
        converged: it is an equilibrium, to the tolerance.
        residual: estimated largest distance to the equilibrium over the body's size; infinite where it is not known.
        energy: strain energy [J].
        min_det: least volume ratio at a corner of an element.
        reactions: by handle (6,), as in `StepResult`.
        actuators: by name.
        terms: reports of further terms by name.
        message: what is wrong; empty where nothing is.
        stable: as in `StepResult`.
    """

    converged: bool
    residual: float
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
        base: (n, 3) [m], whose rows of handles' vertices are where they are commanded.
        poses: commanded, by handle.
        commands: of actuators and loads, by name, in the unit of each mode.
        slides, turns: (p, 3) free translations [m] and rotation vectors [rad] of the handles with a free axis.
        orientation: (p, 3, 3) rotations of these handles for which the constant matrix is coupled to them.
        motion: the last step; None where there was none.
        terms: what each term saves.
        elements, shapes: what elements remember under the policies ``energy`` and ``relative``.
        operators: of the elements at the present growth.
        history, part_history: of the descents in the whole body, and in the part that is awake.
        tangent: that preconditions the descents; None for the constant matrix.
        sleep: what is held.
        unfinished: where the last solve was cut; None where it was not.
        soft: direction in which it is softest; None where none was looked for.
        balance: of the equilibrium; None where it is none, or has no energy.
        summary: of the last accepted solve.
        sound: no element is folded or inverted.
        suspect: the positions were given and have folded or inverted elements.
        tried: it was tried in vain to come here from rest.
        anchor: the last state that was an equilibrium, where this one is on the way to one, or where a step failed and
            left elements crumpled.
        ledger: of a body in motion; None without dynamics.
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
    history: History = field(default_factory=History.empty)
    part_history: History = field(default_factory=History.empty)
    tangent: Tangent | None = None
    sleep: Sleep | None = None
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
        """Return by how much each command changes to ``commands``, (c,), each in its own unit."""
        return np.array([commands[name] - value for name, value in self.commands.items()])

    @property
    def dissipated(self) -> float:
        """What terms have turned to heat so far [J]: each keeps it as `lost`."""
        return sum(float(saved["lost"][0]) for saved in self.terms.values() if "lost" in saved)

    def with_(self, **changes: object) -> State:
        """Return a state that differs in the named attributes.

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
        scene: text of the scene, policy and torsion that it is of.
    """

    state: State
    time: float
    targets: Mapping[str, Pose]
    commands: Mapping[str, float]
    scene: str = ""

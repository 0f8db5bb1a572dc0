# SPDX-License-Identifier: Apache-2.0
"""The interface of a term: an additional contribution to the potential that a solve minimises.

The minimisation uses the sum of all terms and the gradient of the sum. The elements are the first term and have kernels
of their own. Every other term is a compiled function of the positions and of two arrays that the term fills. Solves
call the function by its address. No combination of terms needs a compilation of its own, and absent terms cost nothing.
`docs/terms.md` shows how to add a term.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from llvmlite import ir
from numba import carray, types
from numba.extending import intrinsic
from numpy.typing import NDArray
from scipy import sparse

from gdfe_ros.actuators.actuator import ActuatorState
from gdfe_ros.compiled import inlined, kernel
from gdfe_ros.compiling.linked import compile_linked_entry
from gdfe_ros.constraints import Pose
from gdfe_ros.mesh.triples import along, corner
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.state import Saved, State
from gdfe_ros.solver.vectors import Array

_REALS, _INTEGERS = types.CPointer(types.float64), types.CPointer(types.int32)
_ENTRY = types.float64(_REALS, types.intp, _REALS, types.intp, _INTEGERS, types.intp, _REALS, _REALS)


class TermKernel:
    """The compiled entry of a term; it is compiled, or loaded from a cache, when its address is first used.

    Args:
        entry: function that receives the arguments of `as_arrays` and returns the energy.
    """

    def __init__(self, entry: Callable[..., float]) -> None:
        self._entry = entry

    @cached_property
    def address(self) -> int:
        """Address of the machine code."""
        try:
            self._compiled = compile_linked_entry(_ENTRY, self._entry, cache=True)
        except RuntimeError:  # defined at a prompt: there is no file next to which a cache could be stored
            self._compiled = compile_linked_entry(_ENTRY, self._entry, cache=False)
        return self._compiled.address


def term_kernel(entry: Callable[..., float]) -> TermKernel:
    """Return the compiled entry of a term, for use as decorator; solves call the entry by its address.

    An entry has the form

        @term_kernel
        def spring_entry(x, n, reals, k, integers, i, force, size):
            return spring_energy(*as_arrays(x, n, reals, k, integers, i, force, size))

    Here ``spring_energy(x, reals, integers, force, size)`` is a `gdfe_ros.compiled.kernel`. It receives the positions
    ``x`` (n, 3) [m] and the term's two arrays. It adds dE/dx to ``force`` (n, 3) [N], and to ``size[0]`` [J] the sum of
    the absolute values of the energy's summands, which bounds its rounding. It returns the energy [J]: infinity for
    positions out of bounds.
    """
    return TermKernel(entry)


@inlined
def as_arrays(x, n, reals, k, integers, i, force, size):
    """Return the pointers of an entry's arguments as arrays: positions, reals, integers, force and size."""
    return carray(x, (n, 3)), carray(reals, (k,)), carray(integers, (i,)), carray(force, (n, 3)), carray(size, (1,))


@inlined
def weighted(x, vertices, at, weights, first, count):
    """Return a weighted sum (3,) of ``count`` positions: ``vertices`` begin at ``at``, ``weights`` at ``first``."""
    total = 0.0, 0.0, 0.0
    for a in range(count):
        total = along(1.0, total, weights[first + a], corner(x, vertices[at + a]))
    return total


@inlined
def share(force, vertices, at, weights, first, count, pull):
    """Add ``pull`` (3,), the derivative of an energy with respect to a `weighted` sum, to ``force`` (n, 3)."""
    for a in range(count):
        for axis in range(3):
            force[vertices[at + a], axis] += weights[first + a] * pull[axis]


def spread(weights: Array, blocks: Array) -> Array:
    """Return the tangents (k, 3 c, 3 c) of k energies; each depends on a sum of c positions with ``weights`` (k, c).

    ``blocks`` (k, 3, 3) are the second derivatives of the energies with respect to these sums.
    """
    found = weights[:, :, None, None, None] * weights[:, None, None, :, None] * blocks[:, None, :, None, :]
    return found.reshape(len(found), 3 * weights.shape[1], 3 * weights.shape[1])


class Term:
    """Base class of all terms; a term overrides the methods that it needs.

    Attributes:
        name: unique name among the terms of a body; for an actuator or load, its name in the scene.
        kernel: compiled entry, made by `term_kernel`; None for a term without energy.
        reals: (k,) float64 data for the kernel; written by `begin` and `update`.
        integers: (i,) int32 data for the kernel; written by `begin` and `update`.
        updates: whether `update` changes multipliers.
        inside: whether the body was inside of the term's obstacle at the beginning of the solve.
        wanders: whether updates do not settle, so that the increment should be shorter.
        delicate: whether the term's forces change within tiny displacements, as at the onset of slip.
        exact: whether `tangents`, `spring` and `stiffness` are the whole second derivative of the term's energy.
        stage: a number; when it changes, the kept tangent is evaluated anew, because `tangents` have changed much.
        unbounded: whether a command can leave the energy without a lower bound, such as a pressure beyond its limit
            point.
        conservative: whether the forces have a potential; without one, the stability of an equilibrium is not known.
        even: whether `stiffness` is the term's whole tangent, acts on x, y and z alike, and never changes. Kept
            tangents then use it directly.
    """

    kernel: TermKernel | None = None
    updates, even, exact, inside, delicate, wanders, unbounded = False, False, False, False, False, False, False
    stage, conservative = 0, True

    def __init__(self, name: str, reals: Array, integers: NDArray[np.int32]) -> None:
        self.name, self.reals, self.integers = name, reals, integers

    def stiffness(self) -> sparse.spmatrix | None:
        """Return the term's contribution to the constant matrix (n, n) [N/m]; None if it has none."""
        return None

    def couplings(self) -> NDArray[np.int32]:
        """Return the vertices (k, c) that `tangents` couples; empty if the term adds no tangents."""
        return np.zeros((0, 1), np.int32)

    def tangents(self, positions: Array) -> Array:
        """Return the term's part (k, 3 c, 3 c) [N/m] of the kept tangent, between neighbouring vertices.

        It speeds up the minimisation; no equilibrium depends on it. If this part is the whole second derivative
        (`exact`), a factor of the tangent proves the stability of an equilibrium.
        """
        return np.zeros((0, 3, 3))

    def has_spring(self, positions: Array) -> bool:
        """Return whether the term couples vertices at ``positions`` (n, 3) [m] that are no neighbours, see `spring`."""
        return False

    def spring(self, positions: Array) -> Array:
        """Return the spring (n, 3) [(N/m)^(1/2)] by which a term couples vertices that are no neighbours.

        The result is the square root of the spring's stiffness times the derivative of its length at ``positions`` (n,
        3) [m]. It has the same purpose as `tangents`.
        """
        return np.zeros_like(positions)

    def fit(self, matrix: ConstantMatrix) -> None:
        """Set penalties in proportion to the body's stiffness, which the constant ``matrix`` gives."""

    def neutral(self) -> Saved:
        """Return the initial stored state."""
        return {}

    def set_targets(self, poses: Mapping[str, Pose], last: State) -> None:
        """Store the commanded poses of handles and obstacles, and the previous state, before a solve begins."""

    def begin(self, commands: Mapping[str, float], saved: Saved, positions: Array, ratio: float) -> None:
        """Prepare a solve.

        Args:
            commands: dict from actuator or load name to command.
            saved: the term's stored state after the last accepted step.
            positions: (n, 3) [m] at the start of the solve; energies may be relative to them.
            ratio: ``positions`` are predicted: the last state plus this multiple of the last step's displacement.
                Multipliers may be extrapolated likewise.
        """

    def update(self, positions: Array) -> float:
        """Update the multipliers between minimisations; return the largest error [m] of the constraints."""
        return 0.0

    def finish(self, saved: Saved, positions: Array) -> Saved:
        """Return the state to store after a solve that ended at ``positions`` (n, 3) [m] and began with ``saved``."""
        return {}

    def resume(self, commands: Mapping[str, float], saved: Saved, found: Saved, positions: Array) -> None:
        """Restore the end of a solve that began with the state ``saved`` and ended with ``found`` at ``positions``."""
        self.begin(commands, saved, positions, 0.0)

    def vary(self, commands: Mapping[str, float], saved: Saved, positions: Array) -> None:
        """Set other commands or states after `resume`, to differentiate by them; contacts keep their points."""
        self.begin(commands, saved, positions, 0.0)

    @property
    def multipliers(self) -> Array:
        """The multipliers (k,) that `update` changes, a copy; in a converged solve an update no longer changes them."""
        return np.zeros(0)

    @property
    def per_metre(self) -> Array:
        """Order of magnitude of each multiplier's (k,) change per 1 m of displacement."""
        return np.zeros(0)

    def hold(self, multipliers: Array) -> None:
        """Set the multipliers (k,)."""

    def updated(self, positions: Array) -> Array:
        """Return the multipliers (k,) after an update at ``positions`` (n, 3) [m], without changing the term."""
        return np.zeros(0)

    def energy(self, positions: Array) -> float:
        """Return the term's energy [J] at ``positions`` (n, 3) [m] for the energy balance of increments.

        The value must not change if the positions do not change. The default is the energy of the kernel. A term
        overrides this method if its kernel's energy is relative to the start of a solve, or is the energy of a
        multiplier.
        """
        if self.kernel is None:
            return 0.0
        return float(terms_energy(positions, TermTable.of(self), np.zeros_like(positions), np.zeros(1)))

    def flaw(self, positions: Array) -> str:
        """Return a message if positions (n, 3) [m] of a converged solve are not acceptable; empty if they are."""
        return ""

    def ran_away(self, positions: Array, since: Array) -> bool:
        """Return whether the actuator's extent grew without bound from ``since`` to ``positions`` (n, 3) [m]."""
        return False

    def potential(self, positions: Array, command: float) -> tuple[float, float]:
        """Return the potential [J] and its derivative with respect to the command.

        The potential of an actuator or a load is zero while the body is undeformed. It is also zero if a multiplier
        keeps the commanded quantity; the derivative is then the multiplier, with the sign of the work by a rising
        command.
        """
        return self.energy(positions), 0.0

    def state(self, positions: Array) -> ActuatorState | None:
        """Return command, extent and effort at ``positions`` (n, 3) [m]; None if the term has no actuator."""
        return None

    def report(self, positions: Array) -> dict[str, float]:
        """Return a dict from name to value in SI units, for users; it appears in `StepResult.terms`."""
        return {}


class TermTable(NamedTuple):
    """All terms in the layout of the kernels.

    Attributes:
        address: (t,) int64 addresses of the compiled entries; 0 for a term without an energy.
        real_start, integer_start: (t + 1,) int64 offsets of each term's data in ``reals`` and ``integers``.
        reals, integers: the data of all terms; each term has a view of its own part.
    """

    address: NDArray[np.int64]
    real_start: NDArray[np.int64]
    reals: Array
    integer_start: NDArray[np.int64]
    integers: NDArray[np.int32]

    @classmethod
    def of(cls, term: Term) -> TermTable:
        """Return a table of one term with an energy; the table refers to the term's own arrays."""
        ends = [np.array([0, len(numbers)], dtype=np.int64) for numbers in (term.reals, term.integers)]
        return cls(np.array([term.kernel.address], dtype=np.int64), ends[0], term.reals, ends[1], term.integers)

    @classmethod
    def pack(cls, terms: Sequence[Term]) -> TermTable:
        """Return the table of all terms; their data are copied to it, and the terms get views of it."""
        real_start = np.cumsum([0, *(len(term.reals) for term in terms)])
        integer_start = np.cumsum([0, *(len(term.integers) for term in terms)])
        reals = np.concatenate([np.zeros(0), *(term.reals for term in terms)])
        integers = np.concatenate([np.zeros(0, np.int32), *(term.integers for term in terms)]).astype(np.int32)
        for t, term in enumerate(terms):
            term.reals = reals[real_start[t] : real_start[t + 1]]
            term.integers = integers[integer_start[t] : integer_start[t + 1]]
        address = np.array([term.kernel.address if term.kernel else 0 for term in terms], dtype=np.int64)
        return cls(address, real_start.astype(np.int64), reals, integer_start.astype(np.int64), integers)


@intrinsic
def call_term(typingctx, address, x, n, reals, k, integers, i, force, size):
    """Call the compiled entry of a term by its address."""
    pointers = (_REALS, types.intp, _REALS, types.intp, _INTEGERS, types.intp, _REALS, _REALS)
    signature = types.float64(types.intp, *pointers)

    def codegen(context, builder, signature, arguments):
        kinds = [context.get_value_type(kind) for kind in signature.args[1:]]
        function = builder.inttoptr(arguments[0], ir.FunctionType(ir.DoubleType(), kinds).as_pointer())
        return builder.call(function, arguments[1:])

    return signature, codegen


@kernel
def terms_energy(x, table, force, size):
    """Return the energy [J] of all terms at positions ``x`` (n, 3) [m]; write dE/dx to ``force`` (n, 3) [N].

    The sum of the absolute values of the energy's summands [J] is written to ``size`` (1,).
    """
    for i in range(len(force)):
        force[i, 0], force[i, 1], force[i, 2] = 0.0, 0.0, 0.0
    size[0] = 0.0
    energy = 0.0
    for t in range(len(table.address)):
        if table.address[t] == 0:
            continue
        reals = table.reals[table.real_start[t] : table.real_start[t + 1]]
        integers = table.integers[table.integer_start[t] : table.integer_start[t + 1]]
        own = reals.ctypes, len(reals), integers.ctypes, len(integers)
        energy += call_term(table.address[t], x.ctypes, len(x), *own, force.ctypes, size.ctypes)
    return energy

# SPDX-License-Identifier: Apache-2.0
"""Tangent preconditioner: the factored tangent stiffness K at a recent shape, used instead of the constant matrix.

K is the sum of the tangents of the elements and of the terms. Handles with a free axis are eliminated by their Schur
complement, as with the constant matrix.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from gdfe_ros.compiled import kernel
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.descent.lbfgs_workspace import Problem
from gdfe_ros.solver.elements.barrier import add_walls
from gdfe_ros.solver.elements.hexahedra import SPACING
from gdfe_ros.solver.matrix.constant_matrix import eliminate_free
from gdfe_ros.solver.matrix.fronts import Fronts, unturned_solutions
from gdfe_ros.solver.matrix.rotation import make_unrotated, vertex_rotations
from gdfe_ros.solver.matrix.substitution import Kept, solve_kept
from gdfe_ros.solver.matrix.tangent_assembly import Assembly, Tangent
from gdfe_ros.solver.matrix.unknowns import generalise, rigid_motion
from gdfe_ros.solver.terms.term import Term
from gdfe_ros.solver.vectors import Array


@kernel
def add_wall_tangents(x, watched, shape, material, table, force, energy, out):
    """Add the tangents of the fold barriers of the ``watched`` elements (k,) to ``out`` (m, 3 c, 3 c) [N/m].

    They are central differences of `add_walls`. ``x`` (n, 3) is changed and restored; ``force`` (m, c, 3) and
    ``energy`` (m,) are scratch.
    """
    for k in range(len(watched)):
        e = watched[k]
        spacing = SPACING * np.cbrt(shape.volume[e])
        for column in range(3 * shape.cells.shape[1]):
            vertex, axis = shape.cells[e, column // 3], column % 3
            here = x[vertex, axis]
            for side in range(2):
                step = spacing if side == 0 else -spacing
                x[vertex, axis] = here + step
                force[e] = 0.0
                add_walls(x, watched[k : k + 1], shape, material, table, force, energy)
                for a in range(shape.cells.shape[1]):
                    for i in range(3):
                        out[e, column, 3 * a + i] += 0.5 * force[e, a, i] / step
            x[vertex, axis] = here


class TangentLevel:
    """Evaluates, factors and applies kept tangents of a body.

    Args:
        body: the discretised body.
        matrix: (n, n) the assembled constant matrix.
        terms: the external terms.

    Attributes:
        price: cost of factoring a tangent, divided by the cost of a solution with it.
        kept: the loaded factor for the kernels.
        memory: number of bytes of a factor and of the elements' tangents.
        stiffness: (m, 3 c, 3 c) [N/m] tangents of the elements in the last call of `take`.
        affordable: whether a factor takes little time and memory.
        first_shift: first multiple of the constant matrix that is added to a tangent without a factor: the softness of
            the body.
    """

    SHIFT_GROWTH = 10.0
    """If a tangent has no factor, growing multiples of the constant matrix are added to it: each is this factor times
    the last one.
    """
    MOST_SHIFT = 1e12
    """Largest multiple of the constant matrix that is added to a tangent without a factor. If it is not enough, the
    constant matrix replaces the tangent.
    """
    OPERATIONS, MEMORY = 4e10, 1e9
    """Largest number of multiplications of a factorisation (one or two seconds), and largest memory [bytes], with which
    a body has a tangent from the beginning.
    """
    first_shift = 1e-8

    def __init__(self, body: Body, matrix: sparse.csc_matrix, terms: Sequence[Term] = ()) -> None:
        self._body, self._unknowns, self._terms = body, body.unknowns, terms
        count, corners = body.cells.shape
        self.stiffness = np.zeros((0, 3 * corners, 3 * corners))
        self._scratch = np.zeros((count, corners, 3)), np.zeros(count)
        self._assembly = Assembly([body.cells, *(term.couplings() for term in terms)], body.unknowns)
        self._constant = self._assembly.spread(matrix, body.unknowns)
        self._assembly.fix(self._constant, self._constant.copy())
        even = [term.stiffness() for term in terms if term.even or not term.couplings().size]
        even = [stiffness for stiffness in even if stiffness is not None]
        self._even = self._assembly.spread(sum(even).tocsc(), body.unknowns) if even else 0.0
        self._free = 3 * self._assembly.free
        free, graph = self._assembly.free, self._assembly.graph()
        self._among_free = self._assembly.among_free
        kind = np.float32 if body.handles else np.float64  # only double precision conserves the momentum of free bodies
        self._factor = Fronts(graph[:free, :free].tocsr(), body.rest[body.unknowns.free], kind=kind)
        self.price = self._factor.price
        self.affordable = self._factor.operations <= self.OPERATIONS and self._factor.memory <= self.MEMORY
        self.memory = self._factor.memory + 8 * count * (3 * corners) ** 2
        self._loaded: Tangent | None = None
        self._rest: tuple[Tangent, Kept] | None = None
        self._sums = np.empty((len(body.rest), 9))
        self._factor.kept = self._factor.kept._replace(fixed=body.unknowns.fixed)
        self.kept = self._factor.kept

    @property
    def fits(self) -> bool:
        """Whether a factor and the elements' tangents fit into half of the free memory."""
        return self.memory <= 0.5 * os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")

    def factor_tangent(self, problem: Problem, u: Array, x: Array, *, definite: bool = False) -> Tangent | None:
        """Evaluate and factor the tangent at unknowns ``u`` (3 r,) and positions ``x`` (n, 3) [m].

        Beyond a buckling load, for example, the tangent is indefinite. A growing multiple of the constant matrix is
        then added until a factor exists. If no multiple is enough, because the tangent is not finite, for example, the
        constant matrix replaces it.

        Args:
            problem: present data of elements and handles.
            u: the unknowns.
            x: the corresponding positions.
            definite: whether to return None, and to add nothing, if the tangent is not positive definite.

        Raises:
            FloatingPointError: not even the constant matrix has a factor.
        """
        motion = rigid_motion(u, problem.frame, self._unknowns)
        owners = self._find_owners(x)
        here = {"positions": x.copy(), "stages": self._stages(), "owners": owners}
        here["springs"] = generalise(self._springs(x, owners), self._unknowns, motion)
        tangent = self._assembly.blocks([self._stiffen(problem, x), *(term.tangents(x) for term in self._terms)])
        tangent += self._even
        self._assembly.fix(tangent, self._constant)
        shift = 0.0
        while shift <= self.MOST_SHIFT:
            found = {"blocks": tangent + shift * self._constant if shift else tangent, "shift": shift}
            if self._load(Tangent(motion=motion, **found, **here)):
                return self._loaded
            if definite:
                return None
            if not np.isfinite(tangent).all():
                break
            shift = max(self.first_shift, self.SHIFT_GROWTH * shift)
        motion = rigid_motion(np.zeros_like(u), problem.frame, self._unknowns)
        if not self._load(Tangent(blocks=self._constant, motion=motion, shift=shift)):
            raise FloatingPointError("neither the tangent nor the constant matrix has a factor")
        return self._loaded

    def _stiffen(self, problem: Problem, x: Array) -> Array:
        """Compute and return the elements' tangents `stiffness` at ``x`` (n, 3) [m]; the next call overwrites them."""
        if not len(self.stiffness):
            self.stiffness = np.zeros((len(self._body.material), *self.stiffness.shape[1:]))
        shape, material, table = problem.shape, problem.material, problem.table
        given = problem.blocks, material, problem.pressure, problem.scale, table
        self._body.cell_type.tangents(x, shape, *given, self.stiffness)
        add_wall_tangents(x, problem.watch.watched, shape, material, table, *self._scratch, self.stiffness)
        return self.stiffness

    def keep(self, rest: Tangent) -> None:
        """Keep the factor of the loaded tangent ``rest`` permanently; later factors use other arrays."""
        self._rest = rest, self.kept
        self._factor.spare()

    def load(self, tangent: Tangent) -> None:
        """Factor a tangent that `take` returned, in this run or in another run, unless it is already loaded."""
        if self._loaded is None or self._loaded.blocks is not tangent.blocks:
            if self._rest is None or self._rest[0].blocks is not tangent.blocks:
                self._load(tangent)
                return
            self._loaded, self.kept = self._rest
        if self._loaded.springs is not tangent.springs:
            self._connect(tangent)

    def is_outdated(self, tangent: Tangent | None) -> bool:
        """Return whether any `Term.stage` has changed since ``tangent`` was evaluated; None stands for stages of 0."""
        before = np.zeros(0, np.int32) if tangent is None else tangent.stages
        return not np.array_equal(before, self._stages())

    def _stages(self) -> NDArray[np.int32]:
        stages = np.array([term.stage for term in self._terms], dtype=np.int32)
        return stages if stages.any() else stages[:0]

    def reconnect(self, tangent: Tangent, x: Array) -> Tangent:
        """Return the loaded tangent, with new springs at ``x`` (n, 3) [m] if other terms have springs than before.

        The factor of the tangent stays.
        """
        owners = self._find_owners(x)
        if np.array_equal(owners, tangent.owners):
            return tangent
        slopes = self._springs(x, owners)
        self.turn(x)
        frames, free = self.kept.frames.reshape(-1, 3, 3), self._unknowns.free
        slopes[:, free] = np.einsum("vij,kvi->kvj", frames, slopes[:, free])
        self._connect(replace(tangent, springs=generalise(slopes, self._unknowns, tangent.motion), owners=owners))
        return self._loaded

    def turn(self, x: Array) -> None:
        """Rotate the loaded tangent with each vertex, from the tangent's positions to ``x`` (n, 3) [m]."""
        if self._loaded.positions is None:
            return
        before, unknowns, held = self._loaded.positions, self._unknowns, bool(self._body.handles)
        rows = unknowns.free, unknowns.fixed
        vertex_rotations(x, before, self._body.shape, rows, held, self._sums, self.kept.frames)

    def solve(self, gradient: Array, out: Array) -> None:
        """Write the product of K^-1 and ``gradient`` (3 r,) [N] to ``out`` (3 r,) [m]."""
        solve_kept(self.kept, gradient[None], out[None])

    def _find_owners(self, x: Array) -> NDArray[np.int32]:
        """Return the numbers (m,) of the terms that have a spring at ``x`` (n, 3) [m]."""
        return np.array([number for number, term in enumerate(self._terms) if term.has_spring(x)], dtype=np.int32)

    def _springs(self, x: Array, owners: NDArray[np.int32]) -> Array:
        """Return the springs (m, n, 3) of the terms ``owners`` (m,) at ``x`` (n, 3) [m]."""
        return np.array([self._terms[number].spring(x) for number in owners]).reshape(-1, *x.shape)

    def _load(self, tangent: Tangent) -> bool:
        """Factor a tangent; return whether it is positive definite."""
        self._loaded, motion = None, tangent.motion
        blocks = tangent.blocks[self._among_free] if motion.size else tangent.blocks
        if not self._factor.factor(blocks):
            return False
        self.kept = self._factor.kept
        self.kept.frames[...] = make_unrotated(len(self.kept.frames))
        if motion.size:
            pulled = self._assembly.by_members(tangent.blocks) @ motion
            harmonic, inverse, definite = eliminate_free(pulled, motion, partial(unturned_solutions, self.kept))
            if not definite:
                return False
            self.kept = self.kept._replace(harmonic=harmonic, schur=inverse)
        self._connect(tangent)
        return True

    def _connect(self, tangent: Tangent) -> None:
        """Include the springs of ``tangent``, whose other parts are already factored."""
        none, rows, self._loaded = np.zeros((0, 0)), tangent.springs, tangent
        self.kept = self.kept._replace(springs=none, reach=none, inner=none)
        if len(rows):
            reach = unturned_solutions(self.kept, rows.T)
            inner = np.linalg.inv(np.eye(len(rows)) + rows @ reach)
            self.kept = self.kept._replace(springs=rows, reach=np.ascontiguousarray(reach.T), inner=inner)

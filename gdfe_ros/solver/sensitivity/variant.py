# SPDX-License-Identifier: Apache-2.0
"""Variants of a scene with other materials or damping."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from scipy import sparse

from gdfe_ros.actuators.load import AttachedMass, Gravity, Load
from gdfe_ros.materials import Material, cell_densities
from gdfe_ros.materials.table import MaterialTable, pack
from gdfe_ros.mesh.filling import Filling
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.motion import inertia, viscosity
from gdfe_ros.solver.motion.dynamics import Dynamics
from gdfe_ros.solver.motion.inertia import Inertia, mass_matrix
from gdfe_ros.solver.motion.viscosity import Viscosity
from gdfe_ros.solver.terms.dead_load import DeadLoadTerm
from gdfe_ros.solver.terms.term import Term


@dataclass(frozen=True, eq=False, kw_only=True)
class MaterialVariant:
    """Data of a scene that depend on its materials and its damping.

    Attributes:
        materials: dict from name to material, in the scene's order.
        loads: dead loads.
        masses: attached masses.
        filling: filled fraction of the cells.
        dynamics: damping; None for equilibria.
    """

    materials: Mapping[str, Material]
    loads: Sequence[Load]
    masses: tuple[AttachedMass, ...]
    filling: Filling | None
    dynamics: Dynamics | None


class Variant:
    """A body with other materials or damping.

    Args:
        body: the body.
        own: the body's own materials and damping.
        model: the other materials and damping.

    Attributes:
        table: the packed materials of ``model``.
        dynamics: dynamics of ``model``.
    """

    def __init__(self, body: Body, own: MaterialVariant, model: MaterialVariant) -> None:
        materials = tuple(model.materials.values())
        changed = materials != tuple(own.materials.values())
        self.table: MaterialTable = body.cell_type.table(pack(materials)) if changed else body.table
        self._body = replace(body, materials=materials, table=self.table)
        self._own, self._model, self.dynamics = own, model, model.dynamics
        self._heavier = [each.density for each in materials] != [each.density for each in own.materials.values()]

    def terms(self, h: float | None = None, scheme: Dynamics | None = None) -> dict[str, Term]:
        """Return a dict from name to term for the terms that differ from those of the body.

        In motion, ``h`` [s] is the step length, and ``scheme`` has the time integration scheme in use. Both are None
        for equilibria.
        """
        terms = dict(self._loads)
        if h is None:
            return terms
        dynamics = replace(self.dynamics, scheme=scheme.scheme, rho_inf=scheme.rho_inf)
        terms[inertia.NAME] = Inertia(self._body, self.mass, dynamics, h)
        if dynamics.damps:
            terms[viscosity.NAME] = Viscosity(self._body, dynamics, h)
        return terms

    @cached_property
    def _loads(self) -> dict[str, Term]:
        """Dict from name to gravity term if densities differ; otherwise empty."""
        if not self._heavier:
            return {}
        density = cell_densities(self._model.materials, self._body.material)
        loads = [replace(load, density=density) for load in self._model.loads if isinstance(load, Gravity)]
        return {load.name: DeadLoadTerm(load, self._body) for load in loads}

    @cached_property
    def mass(self) -> sparse.csr_matrix:
        """The mass matrix (n, n) [kg]."""
        density, model = cell_densities(self._model.materials, self._body.material), self._model
        return mass_matrix(self._body.rest, self._body.cells, density, model.masses, filling=model.filling)

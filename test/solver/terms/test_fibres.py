# SPDX-License-Identifier: Apache-2.0
"""Layers of fibres: energies in closed form, forces as derivatives, pressurised tubes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gdfe_ros import Command, Simulation
from gdfe_ros.mesh import Mesh, bar
from gdfe_ros.mesh.files.stored_mesh import pack_mesh
from gdfe_ros.mesh.tetmesh import divide
from gdfe_ros.scene import Scene, scene_from_text
from gdfe_ros.simulation_parts.steppers import scene_body
from gdfe_ros.solver.terms.fibres import FibreTerm, fibre_energy
from gdfe_ros.solver.terms.term import TermTable
from test.differences import assert_derivative
from test.written import scene_of, simulate

_EDGES = (0.03, 0.02, 0.01)
_BRAID = float(np.degrees(np.arctan(np.sqrt(2.0))))
"""Angle between axis and fibres of a braid that a pressure neither lengthens nor widens."""


SOFT = """
mesh: {bar: {size: [0.03, 0.02, 0.01], cells: [3, 2, 1]}}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.45}}
handles: {base: {where: {face: x-}, fixed: true}}
"""


def _block(fibres: dict[str, Any], **keys: Any) -> Scene:
    return scene_of(SOFT, fibres=fibres, **keys)


def _tube(fibres: dict[str, Any]) -> Simulation:
    tube = {"inner": 0.009, "outer": 0.01, "length": 0.05, "cells": [1, 32, 20], "cap": 0.002, "cap_cells": 1}
    layer = {"where": {"box": {"x": [1e-4, 0.0499]}}, "along": [1, 0, 0], **fibres}
    air = {"air": {"chamber": {"cavity": 0}}}
    return simulate(SOFT, mesh={"tube": tube}, materials__soft__poisson=0.49, actuators=air, fibres={"layer": layer})


def _term(scene: Scene) -> FibreTerm:
    return FibreTerm(scene.fibres[0], scene_body(scene, np.zeros(3)))


def _energy(scene: Scene, x: np.ndarray) -> tuple[float, np.ndarray]:
    term, force = _term(scene), np.zeros_like(x)
    return fibre_energy(x, term.reals, term.integers, force, np.zeros(1)), force


def _stretched(mesh: Mesh, gradient: np.ndarray) -> np.ndarray:
    return mesh.vertices @ gradient.T


@pytest.mark.parametrize(
    "keys", [{}, {"mesh": {"embedded": pack_mesh(divide(bar(list(_EDGES), [3, 2, 1])))}}], ids=["hex", "tet"]
)
@pytest.mark.parametrize("angle", [0.0, 30.0, 90.0])
def test_a_uniform_strain_has_the_energy_of_the_closed_form(angle: float, keys: dict[str, Any]) -> None:
    """Fibres on one face under a homogeneous deformation: k/2 e^2 times the area, with e along the fibre."""
    layer = {"where": {"face": "z+"}, "along": [1, 0, 0], "angles_deg": [angle], "stiffness": 700.0}
    scene = _block({"layer": {**layer, "compression": True}}, **keys)
    gradient = np.eye(3) + np.array([[0.10, 0.04, 0.0], [-0.02, -0.15, 0.05], [0.03, 0.0, 0.2]])
    fibre = gradient @ [np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0]
    strain = 0.5 * (fibre @ fibre - 1.0)
    expected = 0.5 * 700.0 * strain**2 * _EDGES[0] * _EDGES[1]
    assert _energy(scene, _stretched(scene.mesh, gradient))[0] == pytest.approx(expected, rel=1e-12)
    slack = _block({"layer": layer}, **keys)
    found, force = _energy(slack, _stretched(slack.mesh, gradient))
    assert found == pytest.approx(expected if strain > 0.0 else 0.0, rel=1e-12)
    assert force.any() == (strain > 0.0)


def test_three_families_are_a_sheet_that_is_equal_in_all_directions() -> None:
    """Fibres at 0, 60 and 120 degrees resist a small stretch in any direction of the face alike."""
    layer = {"along": [1, 0.3, 0], "angles_deg": [0, 60, 120], "stiffness": 700.0, "compression": True}
    scene = _block({"sheet": {"where": {"face": "z+"}, **layer}})
    energies = []
    for angle in np.linspace(0.0, np.pi, 7):
        n = np.array([np.cos(angle), np.sin(angle), 0.0])
        energies.append(_energy(scene, _stretched(scene.mesh, np.eye(3) + 1e-4 * np.outer(n, n)))[0])
    assert np.ptp(energies) < 1e-3 * energies[0]
    assert energies[0] == pytest.approx(0.5 * 9.0 / 8.0 * 700.0 * 1e-8 * _EDGES[0] * _EDGES[1], rel=1e-3)


@pytest.mark.parametrize("compression", [True, False])
def test_forces_are_the_derivative_of_the_energy(compression: bool) -> None:
    """Forces of a braid on the whole outer wall equal central differences along random directions."""
    layer = {"along": [1, 0.5, 0.3], "angles_deg": [-30, 30], "stiffness": 700.0, "compression": compression}
    scene = _block({"layer": {**layer, "where": {"face": "z+"}}})
    x = scene.mesh.vertices + 1e-3 * np.random.default_rng(1).standard_normal(scene.mesh.vertices.shape)
    assert_derivative(TermTable.of(_term(scene)), x)


def _widening(simulation: Simulation, angles: list[float], pressure: float) -> float:
    """Return the relative change of the outer radius in the middle of a tube under pressure."""
    for part in (0.4, 1.0):
        assert simulation.step(Command(actuators={"air": part * pressure})).converged, angles
    middle = np.abs(simulation.mesh.vertices[:, 0] - 0.0275) < 1e-3
    return float(np.linalg.norm(simulation.positions[middle, 1:], axis=1).max()) / 0.01 - 1.0


def test_a_braid_widens_or_narrows_with_its_angle() -> None:
    """A braid at 54.7 degrees keeps its width under pressure; at less it widens, at more it narrows."""
    widths = []
    for angle in (35.0, _BRAID, 70.0):
        simulation = _tube({"angles_deg": [angle, -angle], "stiffness": 1e5})
        widths.append(_widening(simulation, [angle], 5e3))
    assert widths[0] > 0.1
    assert abs(widths[1]) < 2e-3
    assert widths[2] < -0.01


def test_hoops_bear_the_pressure() -> None:
    """The strain of stiff hoops around a soft tube is pressure times radius over stiffness."""
    widening = _widening(_tube({"angles_deg": [90.0], "stiffness": 1e5}), [90.0], 5e3)
    assert widening == pytest.approx(5e3 * 0.01 / 1e5, rel=0.1)


def test_derivatives_know_fibres() -> None:
    """The exact derivative of the tip with respect to the pressure equals a difference of two solves."""
    text = _tube({"angles_deg": [60.0, -60.0], "stiffness": 2e3}).scene.source
    scene = scene_from_text(text, overrides={"solver.tolerance": 1e-6, "probes": {"tip": [0.05, 0, 0]}})
    runs = [Simulation(scene) for _ in range(3)]
    for simulation, pressure in zip(runs, (1990.0, 2000.0, 2010.0), strict=True):
        assert simulation.step(Command(actuators={"air": pressure})).converged
    low, middle, high = (simulation.probe_positions()["tip"][0] for simulation in runs)
    found = runs[1].sensitivities(["probes.tip"], ["actuators.air"]).matrix[0, 0]
    assert low < middle < high
    assert found == pytest.approx((high - low) / 20.0, rel=0.01)

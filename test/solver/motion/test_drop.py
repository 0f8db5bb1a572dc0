# SPDX-License-Identifier: Apache-2.0
"""The benchmark of motion: a clamped bar released under gravity, compared with Q2/P-1 elements of another code."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.drop import path_error
from gdfe_ros import Command, Simulation, load_scene
from test.written import advance


def tip_path(**overrides: object) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Return times [s], the tip's path (n, 3) [m] and energies [J] by name."""
    scene = load_scene("drop", overrides={name.replace("__", "."): value for name, value in overrides.items()})
    simulation = Simulation(scene)
    times, path, energies = [], [], []
    while simulation.time < 1.0 - 1e-9:
        result = advance(simulation)
        times.append(result.time)
        path.append(simulation.probe_positions()["tip"])
        energies.append(result.energies)
    names = energies[0]
    return np.array(times), np.array(path), {name: np.array([each[name] for each in energies]) for name in names}


def test_a_coarse_bar_in_long_steps() -> None:
    """With 80 cells and steps of 10 ms, the tip's path is at most 2 % off."""
    times, path, _ = tip_path()
    assert path_error(times, path) < 0.02


def test_a_finer_bar_in_shorter_steps() -> None:
    """With 640 cells and steps of 2 ms, the tip's path is at most 0.5 % off."""
    times, path, _ = tip_path(mesh__bar__cells=[40, 4, 4], dynamics__step=0.002)
    assert path_error(times, path) < 0.005


def test_newmark_keeps_the_energy() -> None:
    """Newmark keeps the total energy of an undamped swing to 0.5 % of the largest kinetic energy for a second."""
    _, _, energies = tip_path(dynamics__scheme="newmark", dynamics__step=0.005)
    total = energies["kinetic"] + energies["elastic"] + energies["potential"]
    assert np.abs(total).max() < 0.005 * energies["kinetic"].max()


@pytest.mark.parametrize("damping", [{"viscosity": 200.0}, {"mass": 1.0}])
def test_what_is_lost_is_accounted_for(damping: dict) -> None:
    """With damping, the dissipated energy never falls and closes the balance to 1 % of the largest kinetic energy."""
    _, _, energies = tip_path(dynamics__scheme="newmark", dynamics__step=0.005, dynamics__damping=damping)
    total = energies["kinetic"] + energies["elastic"] + energies["potential"] + energies["dissipated"]
    assert np.abs(total).max() < 0.01 * energies["kinetic"].max()
    assert (np.diff(energies["dissipated"]) >= 0.0).all()
    assert energies["dissipated"][-1] > 0.05 * energies["kinetic"].max()


def swung_path(scheme: str, step: float) -> np.ndarray:
    """Return the tip's path (n, 3) [m] while the weight rises and falls smoothly within 0.2 s."""
    given = {"mesh.bar.cells": [10, 1, 1], "dynamics.scheme": scheme, "dynamics.step": step, "solver.tolerance": 1e-6}
    simulation, path = Simulation(load_scene("drop", overrides={**given, "program": None})), []
    for number in range(1, round(0.24 / step) + 1):
        factor = float(np.sin(np.pi * number * step / 0.2) ** 4)
        simulation.step(Command(loads={"weight": factor}))
        path.append(simulation.probe_positions()["tip"])
    return np.array(path)


@pytest.mark.parametrize("scheme", ["newmark", "generalised_alpha", "bdf2"])
def test_smooth_paths_converge_with_the_square_of_the_step(scheme: str) -> None:
    """The error of a smooth path, against far shorter steps, is of second order in the step."""
    fine, differences = swung_path(scheme, 0.0005), []
    for step, every in ((0.008, 16), (0.004, 8), (0.002, 4)):
        away = np.abs(swung_path(scheme, step) - fine[every - 1 :: every])
        differences.append(away[16 // every - 1 :: 16 // every].max())
    orders = np.log2(np.array(differences[:-1]) / differences[1:])
    assert orders == pytest.approx(2.0, abs=0.2)

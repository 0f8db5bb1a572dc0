# SPDX-License-Identifier: Apache-2.0
"""Tests of other simulators that have numbers, repeated with this solver by the rules of their authors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from gdfe_ros import Simulation, load_scene

SCENES = Path(__file__).with_name("scenes")
"""Folder of the scenes, drawn after the sizes, materials and loads of the tests."""
RULES = Path(__file__).with_name("rules.yaml")
"""The tests and the rules of their authors."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """A test of others beside this solver.

    Attributes:
        source: project and name of the test.
        path: file of the test in the project's repository.
        body: what is simulated.
        rule: quantity, and the bound of the test's authors.
        figure: this solver's value as text.
        value: the value, or its distance from what the rule expects, in the rule's unit.
        bound: largest ``value`` that the rule allows.
        revision: commit of the file, if later revisions of the repository do not have it.
    """

    source: str
    path: str
    body: str
    rule: str
    figure: str
    value: float
    bound: float
    revision: str = "HEAD"

    @property
    def holds(self) -> bool:
        """Whether the rule holds."""
        return self.value <= self.bound


def rows_of(found: Mapping[str, tuple[float, str]]) -> list[Row]:
    """Return a row for each test, from a dict from its key in `RULES` to its value and figure."""
    rules = yaml.safe_load(RULES.read_text(encoding="utf-8"))
    return [Row(**rules[key], value=value, figure=figure) for key, (value, figure) in found.items()]


def simulate(name: str, **overrides: Any) -> Simulation:
    """Return the simulation of a scene in `SCENES`; a double underscore in a key of ``overrides`` stands for a dot."""
    keys = {key.replace("__", "."): value for key, value in overrides.items()}
    return Simulation(load_scene(SCENES / f"{name}.yaml", overrides=keys))


def solve(simulation: Simulation, steps: int | None = None) -> Simulation:
    """Play the program in ``steps`` steps, or make one step if the scene has none; return the simulation.

    Raises:
        RuntimeError: a step did not converge.
    """
    for result in simulation.play(steps) if simulation.scene.program else [simulation.step()]:
        if not result.converged:
            raise RuntimeError(f"{simulation.scene.name} did not converge: {result.message}")
    return simulation

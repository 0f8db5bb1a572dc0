# SPDX-License-Identifier: Apache-2.0
"""Fuzzing of the scene reader: any text gives a scene that can be simulated or a SceneError, and never a crash."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import assume, example, given
from hypothesis import strategies as st

from gdfe_ros.errors import SceneError
from gdfe_ros.scene import scene_from_text
from gdfe_ros.simulation import Simulation
from test.torture.examples import ODD, entries_of, examples, with_value

SOUND = """\
name: sound
mesh:
  bar: {size: [0.2, 0.05, 0.05], cells: [4, 2, 2]}
materials:
  soft: {law: linear, young: 1.0e5, poisson: 0.45, density: 1.0e3}
  hard: {law: ogden, mu: [1.0e6], alpha: [2.0], poisson: 0.49, density: 1.0e3}
  sleeve: {law: curve, strain: [0.1, 0.5, 1.0], stress: [1.0e4, 4.0e4, 7.0e4], poisson: 0.4, density: 1.0e3}
regions:
  - {material: soft}
  - {material: hard, where: {box: {x: [0.1, 0.15]}}}
  - {material: sleeve, where: {box: {x: [0.15, 0.2]}}}
handles:
  base: {where: {face: x-}, fixed: true}
  tip: {where: {face: x+}, free: [x]}
  rail: {where: {box: {x: [0.04, 0.16], z: [-0.03, -0.02]}}, slide: [x, y]}
actuators:
  tendon:
    cable:
      points: [{world: [0.0, 0.0, 0.2]}, [0.0, 0.0, 0.02], [0.1, 0.0, 0.02]]
      command: tension
      range: [0.0, 10.0]
loads:
  weight: {gravity: [0, 0, -9.81]}
probes: {middle: [0.1, 0.0, 0.0]}
program:
  duration: 1.0
  handles:
    tip:
      - {time: 0.0}
      - {time: 1.0, translation: [0, 0, 0.02], rotation_deg: [0, 10, 0]}
  actuators:
    tendon: [{time: 1.0, value: 0.5}]
solver: {policy: energy, tolerance: 1.0e-3, max_iterations: 200}
"""
DATA = yaml.safe_load(SOUND)
pytestmark = pytest.mark.usefixtures("limited")
QUICK = examples(120)
PLACES = entries_of(DATA)


def _check(text: str) -> None:
    """Read a text; a scene must be simulated for a step without a crash and with finite positions."""
    try:
        scene, defects = scene_from_text(text), None
    except SceneError as error:
        scene, defects = None, error.defects
    if scene is None:
        assert defects
        assert all(isinstance(defect, str) and defect for defect in defects)
        return
    assume(scene.mesh.n_cells <= 64)
    try:
        simulation = Simulation(scene)
    except SceneError:
        return
    for result in list(simulation.play(steps=1)) if scene.program else [simulation.step()]:
        assert np.isfinite(result.positions).all()
        assert result.converged or result.message


@given(st.sampled_from(PLACES), ODD)
@example(("mesh", "bar", "cells"), [10**9, 10**9, 10**9])
@example(("mesh", "bar", "cells"), [1, 1, 1])
@example(("mesh", "bar", "size"), [1e-300, 1.0, 1.0])
@example(("materials", "soft", "young"), float("nan"))
@example(("program", "duration"), float("inf"))
@example(("program", "handles", "tip", 1, "translation", 1), 213.0)
@QUICK
def test_one_odd_value(place: tuple[Any, ...], value: Any) -> None:
    """A valid scene with one value replaced by anything loads or is refused."""
    _check(yaml.safe_dump(with_value(DATA, place, value), sort_keys=False))


@given(st.lists(st.sampled_from(PLACES), min_size=1, max_size=4, unique=True))
@QUICK
def test_missing_entries(places: list[tuple[Any, ...]]) -> None:
    """A valid scene without some entries loads or is refused."""
    data = copy.deepcopy(DATA)
    for place in sorted(places, key=str, reverse=True):
        target = data
        for key in place[:-1]:
            known = (isinstance(target, dict) and key in target) or (isinstance(target, list) and key < len(target))
            target = target[key] if known else {}
        if isinstance(target, dict):
            target.pop(place[-1], None)
        elif place[-1] < len(target):
            del target[place[-1]]
    _check(yaml.safe_dump(data, sort_keys=False))


@given(st.integers(0, len(SOUND)), st.integers(0, 40), st.text(max_size=12))
@QUICK
def test_spliced_text(start: int, length: int, text: str) -> None:
    """A valid text with a part overwritten by anything loads or is refused."""
    _check(SOUND[:start] + text + SOUND[start + length :])


@given(st.text(max_size=200))
@example("a: &a [*a]")
@example("? [1, 2]\n: x")
@example("!!python/object/apply:os.system ['true']")
@example("[" * 2000)
@example("a: 2024-13-45")
@QUICK
def test_any_text(text: str) -> None:
    """Any text loads or is refused."""
    _check(text)

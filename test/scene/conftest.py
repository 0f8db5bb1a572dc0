# SPDX-License-Identifier: Apache-2.0
"""A sound scene for the tests to break."""

from __future__ import annotations

import pytest

SOUND = """\
name: sound
mesh:
  bar: {size: [0.2, 0.05, 0.05], cells: [4, 2, 2]}
materials:
  soft: {law: linear, young: 1e5, poisson: 0.45}
  hard: {law: ogden, mu: [1.0e6], alpha: [2.0], poisson: 0.49}
regions:
  - {material: soft}
  - {material: hard, where: {box: {x: [0.1, 0.2]}}}
handles:
  base: {where: {face: x-}, fixed: true}
  tip: {where: {face: x+}, free: [x]}
program:
  duration: 2.0
  handles:
    tip:
      - {time: 0.0}
      - {time: 2.0, translation: [0, 0, 0.1], rotation_deg: [0, 90, 0]}
solver: {policy: energy, tolerance: 1.0e-4}
"""


@pytest.fixture
def sound() -> str:
    """Return the text of a sound scene."""
    return SOUND

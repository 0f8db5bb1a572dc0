# SPDX-License-Identifier: Apache-2.0
"""Every kind of actuator is in every list that names kinds, and its units belong together."""

from __future__ import annotations

import pytest

from docs.scripts.scene_examples import EXAMPLES
from gdfe_ros.actuators import Actuator, ActuatorState, Growth, Mode
from gdfe_ros.scene.schemas.actuator_schema import ActuatorModel
from gdfe_ros.solver.forces.actuation import TERMS
from gdfe_ros.solver.terms.term import Term
from test.written import scene_of

SCENE = """
mesh:
  bar:
    size: [0.2, 0.05, 0.05]
    cells: [8, 5, 5]
    cut: [{{box: {{x: [0.05, 0.15], y: [-0.01, 0.01], z: [-0.01, 0.01]}}}}]
materials: {{soft: {{law: neo_hookean, young: 1.0e6, poisson: 0.45}}}}
handles: {{flange: {{where: {{face: x-}}}}}}
actuators: {{it: {entry}}}
"""


def test_every_class_has_a_term() -> None:
    """Every class of actuators has a term with the methods that actuators need; a growth has none."""
    assert set(TERMS) | {Growth} == set(Actuator.__subclasses__())
    for term in TERMS.values():
        assert term.state is not Term.state
        assert term.potential is not Term.potential


@pytest.mark.parametrize("kind", ActuatorModel.model_fields)
def test_every_key_becomes_an_actuator(kind: str) -> None:
    """The example of each key becomes an actuator whose range its mode allows, and whose neutral command is 0."""
    (entry,) = (text for text in EXAMPLES[ActuatorModel] if text.startswith(f"{kind}:"))
    scene = scene_of(SCENE.format(entry=f"{{{entry}}}"))
    (actuator,) = scene.actuators
    assert type(actuator).__name__.lower() == kind
    assert (actuator.low, actuator.high) == actuator.mode.limits
    assert actuator.require(actuator.neutral(scene.mesh.vertices)) == 0.0


@pytest.mark.parametrize("mode", Mode)
def test_units_of_a_mode_belong_together(mode: Mode) -> None:
    """A commanded extent or effort has the unit of the command, and readings have the mode's names and units."""
    assert Mode(mode.value) is mode
    assert mode.limits[0] <= 0.0 <= mode.limits[1]
    if mode.by_effort or mode.by_extent:
        assert mode.unit == (mode.effort_unit if mode.by_effort else mode.extent_unit)
    readings = ActuatorState(mode, 1.0, 2.0, 3.0).readings()
    assert readings[0] == (mode.extent, 2.0, mode.extent_unit)
    assert readings[1:] == ([(mode.effort, 3.0, mode.effort_unit)] if mode.effort else [])

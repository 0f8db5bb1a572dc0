# SPDX-License-Identifier: Apache-2.0
"""Dynamics and attached masses of a scene: accepted keys, and refused values."""

from __future__ import annotations

from typing import Any

import pytest

from gdfe_ros import Simulation, load_scene
from gdfe_ros.errors import SceneError
from gdfe_ros.scene import scene_from_text
from gdfe_ros.solver.settings import Branch, Damping, Policy, Scheme, SolverSettings


def test_all_keys_are_read() -> None:
    """Every key of the dynamics is read."""
    given = {
        "dynamics": {
            "scheme": "generalised_alpha",
            "rho_inf": 0.5,
            "step": 0.001,
            "damping": {"mass": 0.1, "viscosity": 20.0},
            "prony": [{"share": 0.2, "time": 0.1}],
            "velocity": [0, 0, 1],
            "spin": [1, 0, 0],
        },
        "masses": {"camera": {"mass": 0.1, "where": {"face": "x+"}}},
    }
    scene = load_scene("drop", overrides=given)
    found = scene.dynamics
    assert (found.scheme, found.rho_inf, found.step) == (Scheme.GENERALISED_ALPHA, 0.5, 0.001)
    assert (found.damping, found.prony) == (Damping(0.1, 20.0), (Branch(0.2, 0.1),))
    assert (found.velocity, found.spin) == ((0, 0, 1), (1, 0, 0))
    assert [(item.name, item.mass, len(item.points.corners)) for item in scene.masses] == [("camera", 0.1, 9)]


@pytest.mark.parametrize("place", [{"where": {"face": "x+"}}, {"probe": "tip"}], ids=["vertices", "probe"])
def test_attached_masses_weigh(place: dict[str, Any]) -> None:
    """The clamp carries an attached mass of 100 g and a bar of 80 g, without dynamics."""
    weights = {"masses": {"camera": {"mass": 0.1, **place}}, "dynamics": None}
    result = Simulation(load_scene("drop", overrides=weights)).step()
    assert result.reactions["base"][2] == pytest.approx(0.18 * 9.81, rel=1e-3)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("dynamics.scheme", "euler", "scheme"),
        ("dynamics.step", 0.0, "longest internal step in time"),
        ("dynamics.step", 11.0, "longest internal step in time"),
        ("dynamics.rho_inf", 1.1, "rho_inf"),
        ("dynamics", {"scheme": "bdf2", "rho_inf": 0.8}, "rho_inf = 0.8 (override): belongs to the scheme generalised"),
        ("dynamics.damping.viscosity", -1.0, "viscosity"),
        ("dynamics.damping.mass", -0.1, "mass"),
        ("dynamics.prony", [{"share": 0.6, "time": 1}, {"share": 0.5, "time": 2}], "sum to 1.1; allowed: less than 1"),
        ("dynamics.prony", [{"share": 0.6, "time": 0}], "time"),
        ("dynamics.velocity", [0, 0], "velocity"),
        ("dynamics.stepp", 0.1, "stepp"),
        ("materials.rubber.density", None, "dynamics need a density: give `density` [kg/m^3] to rubber"),
        ("materials.rubber.density", -3, "density"),
        ("masses", {"camera": {"mass": 0.0, "where": {"face": "x+"}}}, "mass"),
        ("masses", {"camera": {"mass": 0.1, "where": {"box": {"x": [5, 6]}}}}, "camera"),
        ("masses", {"camera": {"mass": 0.1}}, "give either where or probe"),
        ("masses", {"camera": {"mass": 0.1, "probe": "tip", "where": {"face": "x+"}}}, "give either where or probe"),
        ("masses", {"camera": {"mass": 0.1, "probe": "tipp"}}, "no such probe; did you mean 'tip'? allowed: tip"),
    ],
)
def test_bad_input_is_named(key: str, value: Any, said: str) -> None:
    """A bad value is refused with its key and what is allowed."""
    with pytest.raises(SceneError) as error:
        load_scene("drop", overrides={key: value})
    assert said in str(error.value)


def test_the_policy_relative_does_not_move() -> None:
    """The policy relative with dynamics is refused, in the file or later, with a remedy."""
    with pytest.raises(SceneError, match="cannot take dynamics; remedy: policy: energy"):
        load_scene("drop", overrides={"solver.policy": "relative", "loads": {}, "program": None})
    scene = load_scene("drop", overrides={"loads": {}, "program": None})
    with pytest.raises(SceneError, match="cannot take dynamics"):
        Simulation(scene, settings=SolverSettings(policy=Policy.RELATIVE))


def test_an_empty_entry_is_no_silent_equilibrium() -> None:
    """An empty entry of dynamics is refused with two remedies."""
    text = load_scene("drop").source.replace("dynamics: {scheme: generalised_alpha, step: 0.01}", "dynamics:")
    with pytest.raises(SceneError, match="for the defaults, or leave it out"):
        scene_from_text(text)

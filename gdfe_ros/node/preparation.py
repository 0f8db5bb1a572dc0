# SPDX-License-Identifier: Apache-2.0
"""Preparation of a simulation from the node's parameters: loading, factoring, compiling."""

from __future__ import annotations

from collections.abc import Mapping

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.moduli import given_moduli
from gdfe_ros.node.parameters import NodeParameters
from gdfe_ros.scene.loader import load_scene
from gdfe_ros.simulation import Simulation


def prepare(parameters: NodeParameters, given: Mapping[str, object]) -> Simulation:
    """Return a simulation of the scene with its overrides and moduli, factored and compiled.

    Args:
        parameters: parameters of the node.
        given: parameters that were given at start, by name; some of them may be moduli.

    Raises:
        GdfeError: the scene or the overrides have defects; the text lists all of them.
    """
    overrides = _overrides(parameters.entries("scene_overrides"))
    scene = load_scene(parameters["scene"], overrides=overrides)
    moduli = given_moduli(given, scene)
    if moduli:
        scene = load_scene(parameters["scene"], overrides={**overrides, **moduli})
    simulation = Simulation(scene)
    simulation.warm_up()
    return simulation


def _overrides(entries: list[str]) -> Mapping[str, str]:
    pairs = [entry.partition("=") for entry in entries]
    wrong = [entry for entry, (_, equals, _) in zip(entries, pairs, strict=True) if not equals]
    if wrong:
        raise GdfeError(
            f"parameter scene_overrides holds {wrong}; each entry must be key=value, e.g. solver.tolerance=1e-6"
        )
    return {key.strip(): value.strip() for key, _, value in pairs}

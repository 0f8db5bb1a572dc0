# SPDX-License-Identifier: Apache-2.0
"""The simulated quantity to which an entry of a match file refers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators import Cable, Chamber
from gdfe_ros.errors import GdfeError, MeshError
from gdfe_ros.fitting.match_schema import AXES, CompareModel
from gdfe_ros.fitting.observable import CLOUDS, POSITIONS, Observable, QuantityKind, require_known
from gdfe_ros.fitting.units import FACTORS
from gdfe_ros.mesh import select_vertices
from gdfe_ros.scene.scene import Scene


def matched_observable(model: CompareModel, scene: Scene, where: str) -> Observable:
    """Return the simulated quantity to which an entry refers.

    Raises:
        GdfeError: the scene lacks the named item, or the selection of vertices is invalid or empty.
    """
    key, value = model.chosen
    if key == "mean":
        try:
            vertices = select_vertices(scene.mesh, value.build())
        except MeshError as error:
            raise GdfeError(f"{where}: {error}") from error
        if not vertices.size:
            raise GdfeError(f"{where}: `mean` selects no vertex of scene {scene.name!r}")
        return Observable(QuantityKind.MEAN, vertices=vertices, displacement=model.displacement)
    kind = QuantityKind(value) if key == "cloud" else QuantityKind(key)
    name = "" if key == "cloud" else value
    require_known(kind, name, scene, where)
    return Observable(kind, name, displacement=model.displacement, actuator_unit=_actuator_unit(kind, name, scene))


def _actuator_unit(kind: QuantityKind, name: str, scene: Scene) -> str:
    """Return the SI unit of an actuator's effort or extent; empty for other quantities and for growth."""
    units = {Cable: ("N", "m"), Chamber: ("Pa", "m^3")}
    actuator = next((each for each in scene.actuators if each.name == name), None)
    if kind not in (QuantityKind.EFFORT, QuantityKind.EXTENT):
        return ""
    return units.get(type(actuator), ("", ""))[kind is QuantityKind.EXTENT]


def along_of(
    model: CompareModel, observable: Observable, where: str
) -> tuple[tuple[str, ...], NDArray[np.float64] | None]:
    """Return the labels of the c measured columns, and their directions (c, 3); None for a scalar or a cloud.

    Raises:
        GdfeError: one column of a vector has no direction or a zero direction, or a scalar has `columns`.
    """
    vector = observable.kind in POSITIONS or observable.kind is QuantityKind.FORCE
    if observable.kind in CLOUDS or (not vector and not model.columns):
        return ("",), None
    if not vector:
        raise GdfeError(f"{where}: an actuator has one number; give `column`, not `columns`")
    if model.columns or (model.topic and model.along is None):
        axes = [axis for axis in AXES if not model.columns or axis in model.columns]
        return tuple(axes), np.array([[float(axis == other) for other in AXES] for axis in axes])
    if model.along is None:
        raise GdfeError(
            f"{where}: along what is column {model.column!r} measured? give `along: [x, y, z]`, or `columns`"
        )
    length = float(np.linalg.norm(model.along))
    if length == 0.0:
        raise GdfeError(f"{where}: along has no direction: {model.along}")
    return ("",), np.array([model.along]) / length


def scale_of(unit: str | None) -> float:
    """Return the factor that converts a unit to SI."""
    return FACTORS[unit or "1"]

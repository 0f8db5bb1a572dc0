# SPDX-License-Identifier: Apache-2.0
"""Match files, which assign the columns and topics of recordings to simulated quantities: keys, units, recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Field, Tag, ValidationError, model_validator

from gdfe_ros.errors import DefectsError, GdfeError, MeshError
from gdfe_ros.fitting.recording import CLOUDS, POSITIONS, Observable, QuantityKind, require_known
from gdfe_ros.mesh import select_vertices
from gdfe_ros.mesh.selection import Where
from gdfe_ros.quantity import Quantity, Vector
from gdfe_ros.scene.base_entry import TAG, VALUE_ERROR, Choice, Entry
from gdfe_ros.scene.document import parse_document
from gdfe_ros.scene.scene import Scene
from gdfe_ros.untrusted.bounded_text import LARGEST_TEXT
from gdfe_ros.untrusted.regular_file import read_text

FACTORS = {
    "m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254,
    "N": 1.0, "mN": 1e-3, "gf": 9.80665e-3, "kgf": 9.80665,
    "Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "mbar": 1e2, "bar": 1e5, "psi": 6894.757293168,
    "m^3": 1.0, "l": 1e-3, "ml": 1e-6,
    "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9,
    "1": 1.0,
}  # fmt: skip
"""Dict from unit to its value in SI units."""
Unit = Literal[tuple(FACTORS)]
AXES = ("x", "y", "z")
_SHIFT = Quantity("time by which the recording's clock is ahead of the simulation's", "s", least=-1e6, most=1e6)
_BETWEEN = Quantity("bounds of the time shift", "s", least=-1e6, most=1e6, count=2, ascending=True)
_ALONG = Quantity("direction [x, y, z] that a single column is measured along", count=3)
_RANGE = Quantity("least and largest value of a column", count=2, ascending=True, infinite=True)
_NUMBER = Quantity("command in SI units", least=-1e15, most=1e15)


class _Found(Entry):
    """Source of a quantity in a recording: columns of a CSV file, or a topic of a bag."""

    column: str | None = Field(None, description="CSV: a single column")
    columns: dict[Literal[AXES], str | tuple[str, ...]] = Field(
        {}, description="CSV: column of each axis; several columns are averaged"
    )
    topic: str | None = Field(None, description="bag: name of the topic")
    frame_id: str | None = Field(None, description="bag: child frame in a TFMessage")
    marker: str | None = Field(None, description="bag: `namespace/id` in a Marker or MarkerArray")
    joint: str | None = Field(None, description="bag: name in a JointState, or index in a Float64MultiArray")
    field: Literal["position", "velocity", "effort"] = Field("effort", description="bag: field of a JointState")
    path: str | None = Field(
        None,
        description="bag: path to a number, point, vector or pose in a message of any type, e.g. "
        "`rigid_bodies[0].pose.position` or `rigid_bodies[rigid_body_name=tip].pose`",
    )
    unit: Unit | None = Field(None, description="unit of the numbers (default: SI)")


class CompareModel(_Found, Choice):
    """A measured quantity, and the simulated quantity with which it is compared."""

    options: ClassVar[tuple[str, ...]] = (*_Found.model_fields, "along", "displacement", "sigma")

    probe: str | None = Field(None, description="position of a probe [m]")
    mean: Where | None = Field(None, description="mean position of these vertices [m], e.g. {face: x+}")
    handle: str | None = Field(None, description="position of a handle, obstacle or rigid body from rest [m]")
    force: str | None = Field(None, description="force [N] that a handle or obstacle exerts on the body")
    effort: str | None = Field(None, description="effort of an actuator, e.g. a tension [N]")
    extent: str | None = Field(None, description="extent of an actuator, e.g. a length [m]")
    cloud: Literal["vertices", "surface"] | None = Field(
        None, description="bag: a PointCloud2 of all vertices in order, or of points anywhere on the surface"
    )
    along: Annotated[Vector, _ALONG] | None = None
    displacement: bool = Field(False, description="true: positions are relative to rest, not to the world's origin")
    sigma: Annotated[float, Quantity("standard deviation of a value, in the unit given", above=0.0)] | None = None

    @model_validator(mode="after")
    def _one_place(self) -> CompareModel:
        given = [name for name in ("column", "columns", "topic") if getattr(self, name)]
        if len(given) > 1:
            raise ValueError(f"give one of column, columns, topic; given: {', '.join(given)}")
        return self


class CommandModel(_Found):
    """A column or topic that commanded an actuator, a load or a handle."""


def _kind_of_command(value: Any) -> str:
    return TAG + ("found" if isinstance(value, dict | CommandModel) else "number")


class FrameModel(Entry):
    """Pose of the scene's frame in the recording's frame: x_recorded = R x + t."""

    fit: Literal["translation", "pose"] = Field(
        "pose", description="fit the translation t alone, or the rotation R and t"
    )


class RecordingModel(Entry):
    """Options for reading a recording; the options of one recording replace those for all recordings."""

    file: str | None = Field(None, description="name of the file (default: the name of the recording)")
    time: str | None = Field(None, description="CSV: column of the time; without it each row is an equilibrium")
    time_unit: Unit = "s"
    where: dict[str, Annotated[tuple[float, float], _RANGE]] = Field(
        {}, description="CSV: rows that are used, by ranges of their columns, e.g. pressure_mbar: [50, 200]"
    )
    every: Annotated[int, Quantity("use only every n-th sample", least=1, most=1_000_000, whole=True)] = 1
    compare: dict[str, CompareModel] = Field({}, description="measured quantities, by names of your choice")
    commands: dict[
        str,
        Annotated[
            Annotated[float, _NUMBER, Tag(TAG + "number")] | Annotated[CommandModel, Tag(TAG + "found")],
            Discriminator(_kind_of_command),
        ],
    ] = Field(
        {}, description="commands of actuators, loads (factors) and handles: a number, or a recorded column or topic"
    )
    set: dict[str, Any] = Field({}, description="keys of the scene that differ in this recording")
    shift: Annotated[float, _SHIFT] = 0.0
    shift_between: Annotated[tuple[float, float], _BETWEEN] | None = Field(
        None, description="the time shift is fitted within these bounds [s]"
    )
    frame: FrameModel | None = None
    start: Literal["rest", "equilibrium"] = Field(
        "rest", description="initial state of a motion: the rest shape, or the equilibrium under the first commands"
    )


class MatchModel(RecordingModel):
    """A match file."""

    recordings: dict[str, RecordingModel] = Field({}, description="recordings by name; `--holdout` takes these names")


def match_observable(model: CompareModel, scene: Scene, where: str) -> Observable:
    """Return the simulated quantity to which an entry refers.

    Raises:
        GdfeError: the scene lacks the named item, or the selection of vertices is invalid or empty.
    """
    key, value = model.chosen
    if key == "mean":
        try:
            vertices = select_vertices(scene.mesh, value)
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
    """Return the SI unit of an actuator's effort or extent; empty for other quantities and for actuators of growth."""
    if kind not in (QuantityKind.EFFORT, QuantityKind.EXTENT):
        return ""
    mode = next(each.mode for each in scene.actuators if each.name == name)
    return mode.effort_unit if kind is QuantityKind.EFFORT else mode.extent_unit


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


class MatchError(DefectsError):
    """A match file that is invalid, or does not fit the recordings."""


@dataclass(frozen=True)
class Source:
    """A recording to read.

    Attributes:
        name: name of the recording.
        path: path of a CSV file or a bag.
        match: options for reading it.
    """

    name: str
    path: Path
    match: RecordingModel


def find_sources(data: Sequence[Path], match: Path | None) -> list[Source]:
    """Return the recordings in files and bags, with their options from the match file.

    If the match file has no key `recordings`, each file is one recording with the name of the file. Otherwise every
    file must belong to at least one entry of `recordings`. Several recordings may use different rows of one file.
    Recordings whose file is not in ``data`` are left out.

    Raises:
        MatchError: the match file has defects; all are listed.
        GdfeError: a file does not exist, or two files have the same name.
    """
    _require_distinct(data)
    shared, own = _read(match) if match else ({}, {})
    heading = f"match file {match}"
    files = {path.stem: path for path in data} | {path.name: path for path in data}
    sources = []
    for name, entry in own.items():
        path = files.get(str(entry.get("file", name)))
        if path is not None:
            sources.append(Source(name, path, _validate({**shared, **entry}, heading, f"recordings.{name}")))
    taken = {source.path for source in sources}
    rest = [path for path in data if path not in taken]
    if own and rest:
        text = f"no recording takes {', '.join(path.name for path in rest)}; recordings: {', '.join(own)}"
        raise MatchError(heading, [f"recordings: {text}; remedy: name it, or `file: {rest[0].name}` in one of them"])
    return [*sources, *(Source(path.stem, path, _validate(shared, heading, "")) for path in rest)]


def _require_distinct(data: Sequence[Path]) -> None:
    """Raise `GdfeError` if a file does not exist, or if two files have the same name."""
    for path in data:
        if not path.exists():
            raise GdfeError(f"recording {path} does not exist; give CSV files and directories of bags")
    names = [path.stem for path in data]
    if twice := {name for name in names if names.count(name) > 1}:
        raise GdfeError(f"two recordings are named {', '.join(sorted(twice))}; rename a file")


def _read(match: Path) -> tuple[dict[str, object], dict[str, dict[str, object]]]:
    """Return the options for all recordings, and dict from recording to its own options."""
    heading = f"match file {match}"
    try:
        text = read_text(match, most=LARGEST_TEXT)
    except (OSError, UnicodeDecodeError) as error:
        raise MatchError(heading, [f"cannot be read: {error}"]) from error
    shared = dict(parse_document(text, heading=heading).data)
    _validate(shared, heading, "", kind=MatchModel)
    own = shared.pop("recordings", {})
    return shared, own


def _validate(
    data: dict[str, object], heading: str, place: str, *, kind: type[RecordingModel] = RecordingModel
) -> RecordingModel:
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        raise MatchError(heading, [_line(place, item) for item in error.errors(include_url=False)]) from error


def _line(place: str, item: dict) -> str:
    """Return a message about a defect that pydantic found, with its key path."""
    keys = [str(part) for part in item["loc"] if not str(part).startswith(TAG)]
    path = ".".join([*([place] if place else []), *keys])
    if item["type"] == "extra_forbidden":
        return f"{path}: unknown key; keys: {', '.join(RecordingModel.model_fields)}"
    if item["type"] == "literal_error":
        return f"{path}: {item['input']!r} is not allowed; allowed: {item['ctx']['expected']}"
    return f"{path}: {item['msg'].removeprefix(VALUE_ERROR)}"

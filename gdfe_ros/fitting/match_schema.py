# SPDX-License-Identifier: Apache-2.0
"""The keys of a match file, which assign columns or topics of recordings to quantities of a scene."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from gdfe_ros.fitting.units import Unit
from gdfe_ros.scene.entry import TAG, Choice, Entry
from gdfe_ros.scene.quantity import Quantity
from gdfe_ros.scene.where_schema import WhereModel

AXES = ("x", "y", "z")
_SIGMA = Quantity("standard deviation of a value, in the unit given", above=0.0)
_SHIFT = Quantity("time by which the recording's clock is ahead of the simulation's", "s", least=-1e6, most=1e6)
_BETWEEN = Quantity("bounds of the time shift", "s", least=-1e6, most=1e6, count=2, ascending=True)
_ALONG = Quantity("direction [x, y, z] that a single column is measured along", count=3)
_EVERY = Quantity("use only every n-th sample", least=1, most=1_000_000, whole=True)
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

    options: ClassVar[tuple[str, ...]] = (
        "column", "columns", "topic", "frame_id", "marker", "joint", "field", "path", "unit", "along", "displacement",
        "sigma",
    )  # fmt: skip

    probe: str | None = Field(None, description="position of a probe [m]")
    mean: WhereModel | None = Field(None, description="mean position of these vertices [m], e.g. {face: x+}")
    handle: str | None = Field(None, description="position of a handle, obstacle or rigid body from rest [m]")
    force: str | None = Field(None, description="force [N] that a handle or obstacle exerts on the body")
    effort: str | None = Field(None, description="tension [N] or pressure [Pa] of an actuator")
    extent: str | None = Field(None, description="length [m] or volume [m^3] of an actuator")
    cloud: Literal["vertices", "surface"] | None = Field(
        None, description="bag: a PointCloud2 of all vertices in order, or of points anywhere on the surface"
    )
    along: Annotated[tuple[float, float, float], _ALONG] | None = None
    displacement: bool = Field(False, description="true: positions are relative to rest, not to the world's origin")
    sigma: Annotated[float, _SIGMA] | None = None

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
    every: Annotated[int, _EVERY] = 1
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

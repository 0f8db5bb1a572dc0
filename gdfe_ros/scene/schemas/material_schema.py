# SPDX-License-Identifier: Apache-2.0
"""The entries of `materials` and `fibres` of a scene file."""

from __future__ import annotations

from dataclasses import MISSING, fields
from enum import Enum
from functools import reduce
from operator import or_
from typing import Annotated, Any, ClassVar, Literal, get_type_hints

from pydantic import (
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationInfo,
    create_model,
    model_validator,
)

from gdfe_ros.materials import (
    PRESETS,
    ArrudaBoyce,
    Curve,
    CurveData,
    Gent,
    Law,
    Linear,
    Material,
    MooneyRivlin,
    NeoHookean,
    Ogden,
    StableNeoHookean,
    Yeoh,
    preset,
)
from gdfe_ros.materials.material import Density, Omega
from gdfe_ros.materials.published import PUBLISHED, make_published
from gdfe_ros.mesh.selection import Where
from gdfe_ros.quantity import ANY, Quantity, Vector
from gdfe_ros.scene.base_entry import TAG, Entry, belongs
from gdfe_ros.scene.schemas.machine_table import StressTable, read_stress_table
from gdfe_ros.scene.schemas.paths import resolve_path

LAWS = tuple(law.name.lower() for law in Law)
_FORMULAS = (Linear, NeoHookean, StableNeoHookean, Ogden, Yeoh, MooneyRivlin, ArrudaBoyce, Gent)

TENSION_ONLY = (
    "law: curve is exact in uniaxial tension only; for a rubber of Yeoh's law its stress in equibiaxial tension is "
    "20 % too low at stretch 1.25 and 50 % at 2; remedy where that matters: gdfe fit --tensile with --law yeoh or ogden"
)
"""Remark on each material with ``law: curve``."""

_POISSON = Quantity("Poisson's ratio", least=0.0, most=0.5, remedy="0.5 is incompressible; rubber has about 0.499")
_STRAIN = Quantity("engineering strains of the points of the curve", least=0.0, most=100.0, count=ANY, ascending=True)
_SCALE = Quantity("factor on all stresses of the preset", above=0.0, most=1e3)
_STRAIN_MAX = Quantity("largest engineering strain for which the polynomial holds", above=0.0, most=10.0)


def _read_table(value: Any, info: ValidationInfo) -> StressTable:
    return read_stress_table(resolve_path(value, info))


class _Common(Entry):
    model_config = ConfigDict(arbitrary_types_allowed=True)
    poisson: Annotated[float, _POISSON]
    density: Density | None = None
    omega: Omega | None = None


class _Law(_Common):
    """Base class of the entries of laws; the keys of an entry are the arguments of the law's class ``kind``."""

    kind: ClassVar[type[Material]]

    def build(self) -> Material:
        """Return the material."""
        return self.kind(**{name: value for name, value in self if name != "law"})


def _keys_of(law: type[Material]) -> type[_Law]:
    """Return the entry of a law: its keys are the fields of its class."""
    hints, name = get_type_hints(law, include_extras=True), law.law.name.lower()
    own = {
        item.name: (hints[item.name], ... if item.default is MISSING else item.default)
        for item in fields(law)
        if item.name in law.parameters()
    }
    law_key = (Literal[name], Field(description="name of the material law"))
    made = create_model(f"{law.__name__}Model", __base__=_Law, law=law_key, **own)
    made.kind, made.__doc__ = law, law.__doc__
    return made


LAW_MODELS = {law: _keys_of(law) for law in _FORMULAS}
"""Dict from the class of each law with a formula to the schema of its entry."""


class CurveModel(_Common):
    """Law from a curve of uniaxial nominal stress and engineering strain: a polynomial, a csv file, or two lists."""

    law: Literal["curve"] = Field(description="name of the material law")
    coefficients: Annotated[tuple[float, ...], Quantity("coefficients of e, e^2, ...", "Pa", count=ANY)] | None = None
    strain_max: Annotated[float, _STRAIN_MAX] | None = None
    csv: Annotated[StressTable, BeforeValidator(_read_table)] | None = Field(
        None, description="path of a csv file with the columns strain and stress [Pa]"
    )
    strain: Annotated[tuple[float, ...], _STRAIN] | None = None
    stress: Annotated[tuple[float, ...], Quantity("nominal stresses at these strains", "Pa", count=ANY)] | None = None

    @model_validator(mode="after")
    def _one_source(self) -> CurveModel:
        given = [name for name in ("coefficients", "csv", "strain") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError("give exactly one of: coefficients, csv, or strain with stress")
        if (self.strain is None) != (self.stress is None):
            raise ValueError("strain and stress belong together; give both")
        return self

    _of_coefficients = belongs(
        "strain_max", "coefficients", "strain_max belongs to coefficients; remove it: a table ends with its last row"
    )

    def build(self) -> Material:
        """Return the material.

        Raises:
            ValueError: the data do not form a valid curve.
        """
        caveat = "; ".join([*(self.csv.remarks if self.csv is not None else ()), TENSION_ONLY])
        if self.coefficients is not None:
            data = CurveData.polynomial(self.coefficients, strain_max=self.strain_max)
        else:
            source = self.csv or self
            data = CurveData.table(source.strain, source.stress)
        return Curve(data=data, caveat=caveat, poisson=self.poisson, density=self.density, omega=self.omega)


class PresetModel(_Common):
    """A material of the [library](fitting.md#the-material-library)."""

    preset: Literal[PRESETS] = Field(description="name of the material")
    law: Literal["ogden", "curve"] = Field(
        "ogden", description="ogden: Ogden's law, fitted to the measured points; curve: the curve through these points"
    )
    poisson: Annotated[float, _POISSON] | None = Field(
        None, description="Poisson's ratio; default: 0.499 for silicones; required for filaments"
    )
    density: Density | None = Field(
        None, description="density; default: 1070 for dragon_skin_10; unknown for the other presets"
    )
    scale: Annotated[float, _SCALE] = 1.0

    def build(self) -> Material:
        """Return the material.

        Raises:
            ValueError: the preset is a filament, and Poisson's ratio is missing.
        """
        given = dict(self) | {"law": Law[self.law.upper()]}
        return preset(given.pop("preset"), **given)


class PublishedModel(Entry):
    """Constants of a material from a publication ([sets](fitting.md#published-sets))."""

    published: Literal[tuple(PUBLISHED)] = Field(description="name of the set: material, law and source")
    poisson: Annotated[float, _POISSON] | None = Field(None, description="Poisson's ratio; default: that of the set")
    density: Density | None = Field(None, description="density; default: that of the set, if any")
    omega: Omega | None = None
    scale: Annotated[float, _SCALE] = 1.0

    def build(self) -> Material:
        """Return the material."""
        given = dict(self)
        return make_published(given.pop("published"), **given)


def _tag(value: Any) -> str | None:
    if isinstance(value, dict):
        named = next((key for key in ("preset", "published") if key in value), None)
        return TAG + (named or str(value.get("law")))
    return None


_TAGGED = {law.law.name.lower(): model for law, model in LAW_MODELS.items()} | {
    "curve": CurveModel,
    "preset": PresetModel,
    "published": PublishedModel,
}
MaterialModel = Annotated[
    reduce(or_, (Annotated[model, Tag(TAG + name)] for name, model in _TAGGED.items())), Discriminator(_tag)
]


_ANGLES = Quantity("angle of each family of fibres", "degrees", least=-360.0, most=360.0, count=ANY)


class Wall(str, Enum):
    """The walls of a body that can carry fibres."""

    OUTER = "outer"
    INNER = "inner"


class FibreLayerModel(Entry):
    """A thin layer of fibres on faces of the body: hoops, a braid, or a sheet that limits strains."""

    wall: Wall = Field(Wall.OUTER, description="outer: the outside of the body; inner: the walls of its cavities")
    where: Where | None = Field(None, description="faces with all corners in this place; default: the whole wall")
    along: Annotated[
        Vector,
        Quantity("direction [x, y, z] in the axes of the scene", least=-1e6, most=1e6, count=3, direction="[0, 0, 1]"),
    ] = Field(description="direction that is projected onto each face; the angles are measured from it")
    angles_deg: Annotated[tuple[float, ...], _ANGLES] = Field(
        (0.0,),
        min_length=1,
        description="angles of the fibres from `along`, counter-clockwise seen from outside the material; "
        "[90]: hoops around `along`; [0, 60, 120]: a sheet with the same stiffness in all directions",
    )
    stiffness: Annotated[float, Quantity("Young's modulus times thickness", "N/m", above=0.0, most=1e12)]
    compression: bool = Field(False, description="true: the fibres also resist compression; false: they are slack then")

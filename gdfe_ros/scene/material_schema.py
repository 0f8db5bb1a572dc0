# SPDX-License-Identifier: Apache-2.0
"""The entries of `materials` and `fibres` of a scene file."""

from __future__ import annotations

from enum import Enum
from typing import Annotated, Any, ClassVar, Literal

from pydantic import (
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

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
from gdfe_ros.materials.published import PUBLISHED, published
from gdfe_ros.scene.entry import TAG, Entry
from gdfe_ros.scene.paths import resolve_path
from gdfe_ros.scene.quantity import ANY, Quantity
from gdfe_ros.scene.table import StressTable, read_stress_table
from gdfe_ros.scene.where_schema import WhereModel

LAWS = tuple(law.name.lower() for law in Law)

TENSION_ONLY = (
    "law: curve is exact in uniaxial tension only; for a rubber of Yeoh's law its stress in equibiaxial tension is "
    "20 % too low at stretch 1.25 and 50 % at 2; remedy where that matters: gdfe fit --tensile with --law yeoh or ogden"
)
"""Caveat of materials with a curve."""

_POISSON = Quantity(
    "Poisson's ratio",
    least=0.0,
    most=0.5,
    remedy="0.5 is incompressible; rubber has about 0.499",
)
_YOUNG = Quantity("Young's modulus", "Pa", above=0.0, below=1e13, remedy="in Pa: 1 MPa is 1.0e6")
_DENSITY = Quantity("density", "kg/m^3", least=1e-9, below=1e6)
_OMEGA = Quantity("shape factor for the policy relative, instead of the law's own", above=0.0, most=1.0)
_MU = Quantity("moduli mu_i", "Pa", count=ANY)
_ALPHA = Quantity("exponents alpha_i", least=-20.0, most=20.0, count=ANY)
_COEFFICIENTS = Quantity("coefficients of e, e^2, ...", "Pa", count=ANY)
_STRAIN = Quantity("engineering strains of the points of the curve", least=0.0, most=100.0, count=ANY, ascending=True)
_STRESS = Quantity("nominal stresses at these strains", "Pa", count=ANY)
_SCALE = Quantity("factor on all stresses of the preset", above=0.0, most=1e3)
_C10 = Quantity("coefficient of I1 - 3, half of the initial shear modulus of Yeoh's law", "Pa", least=-1e13, most=1e13)
_C20 = Quantity("coefficient of (I1 - 3)^2", "Pa", least=-1e13, most=1e13)
_C30 = Quantity("coefficient of (I1 - 3)^3", "Pa", least=-1e13, most=1e13)
_C01 = Quantity("coefficient of I2 - 3", "Pa", least=-1e13, most=1e13)
_SHEAR = Quantity("shear modulus mu", "Pa", above=0.0, below=1e13, remedy="in Pa: 1 MPa is 1.0e6")
_LOCKING = Quantity("locking stretch of the chains; rubber has 2 to 7", above=1.0, below=1e3)
_LIMIT = Quantity("limit of I1 - 3; rubber has 10 to 100", above=0.0, below=1e6)
_STRAIN_MAX = Quantity("largest engineering strain for which the polynomial holds", above=0.0, most=10.0)


def _read_table(value: Any, info: ValidationInfo) -> StressTable:
    try:
        return read_stress_table(resolve_path(value, info))
    except ValueError as error:
        raise PydanticCustomError("csv", "{text}", {"text": str(error)}) from error


class _Common(Entry):
    model_config = ConfigDict(arbitrary_types_allowed=True)
    poisson: Annotated[float, _POISSON]
    density: Annotated[float, _DENSITY] | None = None
    omega: Annotated[float, _OMEGA] | None = None

    @property
    def common(self) -> dict[str, float | None]:
        """Parameters that all laws have, as a dict from name to value."""
        return {"poisson": self.poisson, "density": self.density, "omega": self.omega}


class _Law(_Common):
    """A law whose parameters have the names of the arguments of its class, ``kind``."""

    kind: ClassVar[type[Material]]

    def build(self) -> Material:
        """Return the material."""
        return self.kind(**{name: value for name, value in self if name != "law"})


class LinearModel(_Law):
    """Corotated linear law: stress is proportional to strain, also under large rotations."""

    kind: ClassVar[type[Material]] = Linear
    law: Literal["linear"] = Field(description="name of the material law")
    young: Annotated[float, _YOUNG]


class NeoHookeanModel(_Law):
    """Neo-Hookean law, W = mu/2 (I1 - 3) - mu ln J + lambda/2 (ln J)^2."""

    kind: ClassVar[type[Material]] = NeoHookean
    law: Literal["neo_hookean"] = Field(description="name of the material law")
    young: Annotated[float, _YOUNG]


class StableNeoHookeanModel(_Law):
    """Stable neo-Hookean law of Smith, de Goes and Kim (2018), smooth also for inverted elements."""

    kind: ClassVar[type[Material]] = StableNeoHookean
    law: Literal["stable_neo_hookean"] = Field(description="name of the material law")
    young: Annotated[float, _YOUNG]


class OgdenModel(_Law):
    """Ogden's law in Abaqus' convention."""

    kind: ClassVar[type[Material]] = Ogden
    law: Literal["ogden"] = Field(description="name of the material law")
    mu: Annotated[tuple[float, ...], _MU]
    alpha: Annotated[tuple[float, ...], _ALPHA]


class YeohModel(_Law):
    """Yeoh's law, W = C10 (I1 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3, with the coefficients of Abaqus."""

    kind: ClassVar[type[Material]] = Yeoh
    law: Literal["yeoh"] = Field(description="name of the material law")
    c10: Annotated[float, _C10]
    c20: Annotated[float, _C20] = 0.0
    c30: Annotated[float, _C30] = 0.0


class MooneyRivlinModel(_Law):
    """Law of Mooney and Rivlin, W = C10 (I1 - 3) + C01 (I2 - 3), with the coefficients of Abaqus."""

    kind: ClassVar[type[Material]] = MooneyRivlin
    law: Literal["mooney_rivlin"] = Field(description="name of the material law")
    c10: Annotated[float, _C10]
    c01: Annotated[float, _C01]


class ArrudaBoyceModel(_Law):
    """Law of Arruda and Boyce: chains of rubber with a locking stretch, with the five terms of Abaqus."""

    kind: ClassVar[type[Material]] = ArrudaBoyce
    law: Literal["arruda_boyce"] = Field(description="name of the material law")
    mu: Annotated[float, _SHEAR]
    lambda_m: Annotated[float, _LOCKING]


class GentModel(_Law):
    """Gent's law, W = -mu Jm / 2 ln(1 - (I1 - 3) / Jm)."""

    kind: ClassVar[type[Material]] = Gent
    law: Literal["gent"] = Field(description="name of the material law")
    mu: Annotated[float, _SHEAR]
    jm: Annotated[float, _LIMIT]


class CurveModel(_Common):
    """Law from a curve of uniaxial nominal stress and engineering strain: a polynomial, a csv file, or two lists."""

    law: Literal["curve"] = Field(description="name of the material law")
    coefficients: Annotated[tuple[float, ...], _COEFFICIENTS] | None = None
    strain_max: Annotated[float, _STRAIN_MAX] | None = None
    csv: Annotated[StressTable, BeforeValidator(_read_table)] | None = Field(
        None, description="path of a csv file with the columns strain and stress [Pa]"
    )
    strain: Annotated[tuple[float, ...], _STRAIN] | None = None
    stress: Annotated[tuple[float, ...], _STRESS] | None = None

    @model_validator(mode="after")
    def _one_source(self) -> CurveModel:
        given = [name for name in ("coefficients", "csv", "strain") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError("give exactly one of: coefficients, csv, or strain with stress")
        if (self.strain is None) != (self.stress is None):
            raise ValueError("strain and stress belong together; give both")
        if self.strain_max is not None and self.coefficients is None:
            raise ValueError("strain_max belongs to coefficients; remove it: a table ends with its last row")
        return self

    def build(self) -> Material:
        """Return the material.

        Raises:
            ValueError: the data do not form a valid curve.
        """
        caveat = "; ".join([*(self.csv.remarks if self.csv is not None else ()), TENSION_ONLY])
        if self.coefficients is not None:
            data = CurveData.polynomial(self.coefficients, strain_max=self.strain_max)
        elif self.csv is not None:
            data = CurveData.table(self.csv.strain, self.csv.stress)
        else:
            data = CurveData.table(self.strain, self.stress)
        return Curve(data=data, caveat=caveat, **self.common)


class PresetModel(_Common):
    """A material of the [library](fitting.md#the-material-library)."""

    preset: Literal[PRESETS] = Field(description="name of the material")
    law: Literal["ogden", "curve"] = Field(
        "ogden", description="ogden: Ogden's law, fitted to the measured points; curve: the curve through these points"
    )
    poisson: Annotated[float, _POISSON] | None = Field(
        None, description="Poisson's ratio; default: 0.499 for silicones; required for filaments"
    )
    density: Annotated[float, _DENSITY] | None = Field(
        None, description="density; default: 1070 for dragon_skin_10; unknown for the other presets"
    )
    scale: Annotated[float, _SCALE] = 1.0

    def build(self) -> Material:
        """Return the material.

        Raises:
            ValueError: the preset is a filament, and Poisson's ratio is missing.
        """
        return preset(self.preset, law=Law[self.law.upper()], scale=self.scale, **self.common)


class PublishedModel(Entry):
    """Constants of a material as somebody has published them ([sets](fitting.md#published-sets))."""

    published: Literal[tuple(PUBLISHED)] = Field(description="name of the set: material, law and source")
    poisson: Annotated[float, _POISSON] | None = Field(None, description="Poisson's ratio; default: that of the set")
    density: Annotated[float, _DENSITY] | None = Field(None, description="density; default: that of the set, if any")
    omega: Annotated[float, _OMEGA] | None = None
    scale: Annotated[float, _SCALE] = 1.0

    def build(self) -> Material:
        """Return the material."""
        given = {"poisson": self.poisson, "density": self.density, "omega": self.omega}
        return published(self.published, scale=self.scale, **given)


def _tag(value: Any) -> str | None:
    if isinstance(value, dict):
        named = next((key for key in ("preset", "published") if key in value), None)
        return TAG + (named or str(value.get("law")))
    return None


MaterialModel = Annotated[
    Annotated[LinearModel, Tag(TAG + "linear")]
    | Annotated[NeoHookeanModel, Tag(TAG + "neo_hookean")]
    | Annotated[StableNeoHookeanModel, Tag(TAG + "stable_neo_hookean")]
    | Annotated[OgdenModel, Tag(TAG + "ogden")]
    | Annotated[YeohModel, Tag(TAG + "yeoh")]
    | Annotated[MooneyRivlinModel, Tag(TAG + "mooney_rivlin")]
    | Annotated[ArrudaBoyceModel, Tag(TAG + "arruda_boyce")]
    | Annotated[GentModel, Tag(TAG + "gent")]
    | Annotated[CurveModel, Tag(TAG + "curve")]
    | Annotated[PresetModel, Tag(TAG + "preset")]
    | Annotated[PublishedModel, Tag(TAG + "published")],
    Discriminator(_tag),
]


_ALONG = Quantity("direction [x, y, z] in the axes of the scene", least=-1e6, most=1e6, count=3)
_ANGLES = Quantity("angle of each family of fibres", "degrees", least=-360.0, most=360.0, count=ANY)
_STIFFNESS = Quantity("Young's modulus times thickness", "N/m", above=0.0, most=1e12)


class Wall(str, Enum):
    """The walls of a body that can carry fibres."""

    OUTER = "outer"
    INNER = "inner"


class FibreLayerModel(Entry):
    """A thin layer of fibres on faces of the body: hoops, a braid, or a sheet that limits strains."""

    wall: Wall = Field(Wall.OUTER, description="outer: the outside of the body; inner: the walls of its cavities")
    where: WhereModel | None = Field(None, description="faces with all corners in this place; default: the whole wall")
    along: Annotated[tuple[float, float, float], _ALONG] = Field(
        description="direction that is projected onto each face; the angles are measured from it"
    )
    angles_deg: Annotated[tuple[float, ...], _ANGLES] = Field(
        (0.0,),
        min_length=1,
        description="angles of the fibres from `along`, counter-clockwise seen from outside the material; "
        "[90]: hoops around `along`; [0, 60, 120]: a sheet with the same stiffness in all directions",
    )
    stiffness: Annotated[float, _STIFFNESS]
    compression: bool = Field(False, description="true: the fibres also resist compression; false: they are slack then")

    @field_validator("along")
    @classmethod
    def _direction(cls, along: tuple[float, float, float]) -> tuple[float, float, float]:
        if not any(along):
            raise ValueError("must not be zero; needed: a direction, e.g. [0, 0, 1]")
        return along

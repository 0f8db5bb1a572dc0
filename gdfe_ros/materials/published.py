# SPDX-License-Identifier: Apache-2.0
"""Published constants of silicones, printed rubbers (TPU) and rubber, with the test from which they come.

Sets of one material often contradict each other: Ecoflex 00-30 has shear moduli from 14 to 34 kPa in the sets below. A
material of a set therefore has a caveat with the range of all sets of this material.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from gdfe_ros.materials.invariant import Gent, Yeoh
from gdfe_ros.materials.material import Material, MooneyRivlin, NeoHookean, Ogden

SOROTOKI = "Caasenbrood, SorotokiCode (MIT)"
MARECHAL = "tests of Marechal et al. 2020, Soft Robotics Materials Database (ODbL); crosshead strain: reads soft"
SOROFORGE = "tests of SoRoForge, MacCurdy Lab, doi 10.1089/3dp.2023.0010"


@dataclass(frozen=True)
class PublishedSet:
    """Constants of a material, and where they come from.

    Attributes:
        material: name of the material; sets of the same material have the same name.
        law: the law with its constants. Poisson's ratio is 0.499 where the source gives none.
        strain: range of the test, in strain or in words.
        kind: test, or use, from which the constants come.
        reference: authors.
    """

    material: str
    law: Material
    strain: str
    kind: str
    reference: str


_Fit = tuple[float, float, float, str, float, float, float]


def _yeoh_fits(reference: str, fits: dict[str, _Fit]) -> dict[str, PublishedSet]:
    """Return a dict from name to set; this project fitted the constants to published tensile tests.

    Args:
        reference: reference of the tests.
        fits: dict from material to its fit: the coefficients c10, c20, c30 [Pa] of Yeoh's law; the range of strains;
            the relative misfit (root mean square) [%]; and the modulus [kPa] and the misfit [%] of a neo-Hookean law.
    """
    return {
        f"{material}_yeoh_tensile": PublishedSet(
            material=material,
            law=Yeoh(c10=c10, c20=c20, c30=c30, poisson=0.499),
            strain=strain,
            kind=f"own fit, relative rms {misfit} % (neo-Hookean mu={mu} kPa: {other} %)",
            reference=reference,
        )
        for material, (c10, c20, c30, strain, misfit, mu, other) in fits.items()
    }


# fmt: off
PUBLISHED: dict[str, PublishedSet] = {
    "ecoflex_00_10_yeoh_sorotoki": PublishedSet(
        "ecoflex_00_10", Yeoh(c10=3000.0, c20=-200.0, c30=23.0, poisson=0.499, density=1070.0),
        "not given", "preset of a public code", SOROTOKI),
    "ecoflex_00_30_yeoh_sorotoki": PublishedSet(
        "ecoflex_00_30", Yeoh(c10=17000.0, c20=-200.0, c30=23.0, poisson=0.499, density=1070.0),
        "not given", "preset of a public code", SOROTOKI),
    "ecoflex_00_50_yeoh_sorotoki": PublishedSet(
        "ecoflex_00_50", Yeoh(c10=14500.0, c20=100.0, c30=0.0, poisson=0.499, density=1070.0),
        "not given", "preset of a public code", SOROTOKI),
    "dragon_skin_10_yeoh_sorotoki": PublishedSet(
        "dragon_skin_10", Yeoh(c10=36000.0, c20=250.0, c30=23.0, poisson=0.499, density=1070.0),
        "not given", "preset of a public code", SOROTOKI),
    "dragon_skin_30_yeoh_sorotoki": PublishedSet(
        "dragon_skin_30", Yeoh(c10=153600.0, c20=1600.0, c30=0.0, poisson=0.499, density=1070.0),
        "not given", "preset of a public code", SOROTOKI),
    "elastosil_shore_28_yeoh_sorotoki": PublishedSet(
        "elastosil_shore_28", Yeoh(c10=110000.0, c20=20000.0, c30=0.0, poisson=0.499, density=1130.0),
        "not given", "preset of a public code; same pair in a second public text (excerpt id 7090028291)", SOROTOKI),
    "rtv615_yeoh_sorotoki": PublishedSet("rtv615", Yeoh(c10=162100.0, c20=14200.0, c30=900.0, poisson=0.499),
        "0..1.5", "preset of a public code", SOROTOKI),
    "elastic_50a_yeoh_sorotoki": PublishedSet(
        "elastic_50a", Yeoh(c10=505600.0, c20=0.0, c30=2562.0, poisson=0.499, density=1200.0),
        "not given", "published", SOROTOKI),
    "ninjaflex_mooney_sorotoki": PublishedSet("ninjaflex", MooneyRivlin(c10=770000.0, c01=2940000.0, poisson=0.499),
        "not given", "published", SOROTOKI),
    "tpu_90a_neo_hooke_sorotoki": PublishedSet("tpu_90a", NeoHookean(young=6900000.0, poisson=0.4, density=1070.0),
        "not given", "preset of a public code", SOROTOKI),
    "ecoflex_00_30_gent_membrane": PublishedSet("ecoflex_00_30", Gent(mu=31700.0, jm=39.6, poisson=0.499),
        "biaxial, to about stretch 2", "used by the authors for a membrane",
        "Campbell et al. 2025, SPA_Design (MIT), arXiv 2504.01156"),
    "dragon_skin_10_neo_hooke_beam": PublishedSet(
        "dragon_skin_10", NeoHookean(young=263824.0, poisson=0.499, density=1070.0),
        "small (beam)", "fitted by the authors to a beam in motion", "Dubied et al. 2022, diffPD_sim2real (MIT)"),
    "silicone_of_the_stiff_flop_module_neo_hooke_stiff_flop": PublishedSet(
        "silicone_of_the_stiff_flop_module", NeoHookean(young=120000.0, poisson=0.499),
        "bending to 75 deg", "used by the authors", "Sadati et al. 2019, TMTDyn (BSD), doi 10.1177/0278364919881685"),
    "ecoflex_00_50_neo_hooke_hanging": PublishedSet(
        "ecoflex_00_50", NeoHookean(young=66855.4, poisson=0.499, density=1080.0),
        "small, depth camera", "fitted by the authors", "Arnavaz et al. 2023, DiffCal, doi 10.1111/cgf.14720"),
    "mold_star_15_neo_hooke_hanging": PublishedSet(
        "mold_star_15", NeoHookean(young=150169.82, poisson=0.499, density=1080.0),
        "small, depth camera", "fitted by the authors", "Arnavaz et al. 2023, DiffCal, doi 10.1111/cgf.14720"),
    **_yeoh_fits(MARECHAL, {
        "bodydouble_silk": (54014.7, 5096.39, -402.768, "0.1..2.00", 5.2, 120.1, 12),
        "dragon_skin_10": (20631.9, 3503.07, -153.855, "0.1..2.00", 1.7, 49.33, 24),
        "dragon_skin_20": (55048.0, 11106.0, -607.913, "0.1..2.00", 3.9, 133.3, 25),
        "dragon_skin_30": (86244.1, 11471.2, -562.353, "0.1..2.00", 2.1, 201.3, 20),
        "dragon_skin_fx_pro_slacker": (1582.7, -63.6018, 5.50079, "0.1..2.00", 6.5, 2.979, 8),
        "dragon_skin_fx_pro": (13507.4, 1267.61, -58.1233, "0.1..2.00", 2.3, 30.64, 16),
        "ecoflex_00_10": (3569.69, 167.02, -3.41165, "0.1..2.00", 3.6, 7.78, 12),
        "ecoflex_00_30": (7156.83, 372.573, -24.0781, "0.1..2.00", 4.1, 15.42, 9),
        "ecoflex_00_35_fast": (12548.9, 937.401, -37.8007, "0.1..2.00", 2.4, 28.03, 15),
        "ecoflex_00_50": (9687.69, 637.684, -35.1511, "0.1..2.00", 3.4, 21.3, 12),
        "mold_star_16_fast": (40575.6, 3444.74, -87.6729, "0.1..2.00", 1.0, 91.95, 18),
        "mold_star_20t": (53407.8, 4134.33, -107.428, "0.1..2.00", 1.1, 120.2, 16),
        "platsil_gel_10": (25323.0, 4923.48, -275.609, "0.1..2.00", 3.0, 61.12, 24),
        "psycho_paint": (58067.5, 3855.27, -106.035, "0.1..2.00", 1.2, 129.2, 15),
        "rtv615": (163529.0, 14177.7, 873.489, "0.1..1.50", 1.1, 365.9, 18),
        "rebound_25": (47085.3, 5514.56, -209.378, "0.1..2.00", 1.4, 109.1, 20),
        "soloplast_150318": (31956.6, 2659.28, -109.274, "0.1..2.00", 2.3, 71.94, 16),
        "sortaclear_40": (138157.0, 6109.52, -66.9927, "0.1..2.00", 0.6, 300.9, 12),
        "wagnersil_20_nf": (53802.7, 10304.5, -409.701, "0.1..2.00", 1.7, 130.2, 26),
    }),
    **_yeoh_fits(SOROFORGE, {
        "diabase_x60": (939563.0, -52400.2, 3380.86, "0.28..1.72", 1.0, 1513, 11),
        "filaflex_60a": (966567.0, -60762.9, 3489.99, "0.28..1.88", 1.8, 1443, 15),
        "filaflex_70a": (1373330.0, -94519.0, 5378.02, "0.28..1.88", 1.7, 1965, 17),
        "hatchbox_tpu": (4484370.0, -423479.0, 25602.7, "0.28..1.97", 6.0, 5394, 24),
        "matterhacker_hq_tpu": (3134630.0, -352236.0, 25937.2, "0.28..1.72", 4.3, 3804, 23),
        "cheetah": (6222420.0, -770198.0, 59809.8, "0.28..1.72", 6.2, 7263, 24),
        "chinchilla": (1367030.0, -88170.1, 4913.82, "0.28..1.97", 2.5, 1990, 16),
        "eel": (5191400.0, -482560.0, 27777.6, "0.28..1.99", 6.1, 6050, 25),
        "ninjaflex": (2407080.0, -201118.0, 12902.0, "0.28..1.88", 3.2, 3267, 19),
        "overture_hs_tpu": (7067670.0, -902204.0, 69401.2, "0.28..1.72", 6.4, 7953, 25),
        "overture_tpu": (4382420.0, -445630.0, 30417.2, "0.28..1.88", 5.8, 5429, 22),
        "pi_etpu": (6188010.0, -590011.0, 41575.6, "0.28..1.79", 6.1, 8250, 20),
        "polymaker_tpu90": (3314180.0, -324623.0, 19293.7, "0.28..1.97", 5.7, 3809, 26),
        "sainsmart_tpu": (2716550.0, -253475.0, 15148.9, "0.28..1.97", 5.8, 3272, 24),
    }),
    "natural_rubber_ogden_treloar": PublishedSet(
        "natural_rubber", Ogden(mu=(369941.495, 1251.5, 16157.977), alpha=(1.463, 5.512, -1.855), poisson=0.499),
        "stretch to 7.6/4.4/5.0", "fit to the test to the three modes together, relative rms 4.3 %", "Treloar 1944"),
    "natural_rubber_neo_hooke_treloar": PublishedSet("natural_rubber", NeoHookean(young=1071785.0, poisson=0.499),
        "uniaxial stretch 1.12..1.89", "own fit, relative rms 11 %", "Treloar 1944"),
    "unfilled_silicone_rtv141_mooney_meunier": PublishedSet(
        "unfilled_silicone_rtv141", MooneyRivlin(c10=155070.0, c01=15526.0, poisson=0.499),
        "uniaxial stretch 0.49..2.17", "own fit, relative rms 7 %", "Meunier et al. 2008"),
    "unfilled_silicone_rtv141_yeoh_meunier": PublishedSet(
        "unfilled_silicone_rtv141", Yeoh(c10=171320.0, c20=-7345.6, c30=3015.5, poisson=0.499),
        "uniaxial stretch 0.49..2.17", "own fit, relative rms 8 %", "Meunier et al. 2008"),
    "isoprene_rubber_mooney_kawabata": PublishedSet(
        "isoprene_rubber", MooneyRivlin(c10=135340.0, c01=62898.0, poisson=0.499),
        "uniaxial stretch 1.04..3.70", "own fit, relative rms 3 %", "Kawabata et al. 1981"),
    "isoprene_rubber_yeoh_kawabata": PublishedSet(
        "isoprene_rubber", Yeoh(c10=190610.0, c20=-5165.7, c30=217.69, poisson=0.499),
        "uniaxial stretch 1.04..3.70", "own fit, relative rms 2 %", "Kawabata et al. 1981"),
}
# fmt: on
"""Dict from the name of each published set to the set."""


def make_published(
    name: str,
    *,
    scale: float = 1.0,
    poisson: float | None = None,
    density: float | None = None,
    omega: float | None = None,
) -> Material:
    """Return the material of a published set, with a caveat about its source and about other sets.

    Args:
        name: one of `PUBLISHED`.
        scale: factor on all stresses.
        poisson: initial Poisson's ratio; None for the set's ratio.
        density: mass density [kg/m^3]; None for the set's density, if it has one.
        omega: shape factor for the ``relative`` policy; None for the law's own factor.

    Raises:
        ValueError: there is no such set.
    """
    if name not in PUBLISHED:
        raise ValueError(f"no published set {name!r}; sets: {', '.join(PUBLISHED)}")
    law = PUBLISHED[name].law
    changes = {
        "poisson": law.poisson if poisson is None else poisson,
        "density": density or law.density,
        "omega": omega,
    }
    for key in (key for key, quantity in type(law).parameters().items() if quantity.unit == "Pa"):
        value = getattr(law, key)
        changes[key] = tuple(scale * each for each in value) if isinstance(value, tuple) else scale * value
    return replace(law, **changes, caveat=caveat_of(name) if scale == 1.0 else "")


def caveat_of(name: str) -> str:
    """Return the test, range and reference of a set, and the range of shear moduli of all sets of its material."""
    one = PUBLISHED[name]
    text = f"{one.reference}: {one.kind}; range: {one.strain}"
    moduli = [1e-3 * each.law.shear0 for each in PUBLISHED.values() if each.material == one.material]
    if len(moduli) > 1:
        text += (
            f"; {len(moduli)} sets of {one.material} have shear moduli from {min(moduli):.3g} to {max(moduli):.3g} kPa"
        )
    return f"{text}; remedy: `scale`, fitted to your own robot with `gdfe fit`"

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
    "bodydouble_silk_yeoh_tensile": PublishedSet(
        "bodydouble_silk", Yeoh(c10=54014.7, c20=5096.39, c30=-402.768, poisson=0.499),
        "0.1..2.00", "own fit, relative rms 5.2 % (neo-Hookean mu=120.1 kPa: 12 %)", MARECHAL),
    "dragon_skin_10_yeoh_tensile": PublishedSet(
        "dragon_skin_10", Yeoh(c10=20631.9, c20=3503.07, c30=-153.855, poisson=0.499),
        "0.1..2.00", "own fit, relative rms 1.7 % (neo-Hookean mu=49.33 kPa: 24 %)", MARECHAL),
    "dragon_skin_20_yeoh_tensile": PublishedSet(
        "dragon_skin_20", Yeoh(c10=55048.0, c20=11106.0, c30=-607.913, poisson=0.499),
        "0.1..2.00", "own fit, relative rms 3.9 % (neo-Hookean mu=133.3 kPa: 25 %)", MARECHAL),
    "dragon_skin_30_yeoh_tensile": PublishedSet(
        "dragon_skin_30", Yeoh(c10=86244.1, c20=11471.2, c30=-562.353, poisson=0.499),
        "0.1..2.00", "own fit, relative rms 2.1 % (neo-Hookean mu=201.3 kPa: 20 %)", MARECHAL),
    "dragon_skin_fx_pro_slacker_yeoh_tensile": PublishedSet(
        "dragon_skin_fx_pro_slacker", Yeoh(c10=1582.7, c20=-63.6018, c30=5.50079, poisson=0.499),
        "0.1..2.00", "own fit, relative rms 6.5 % (neo-Hookean mu=2.979 kPa: 8 %)", MARECHAL),
    "dragon_skin_fx_pro_yeoh_tensile": PublishedSet(
        "dragon_skin_fx_pro", Yeoh(c10=13507.4, c20=1267.61, c30=-58.1233, poisson=0.499),
        "0.1..2.00", "own fit, relative rms 2.3 % (neo-Hookean mu=30.64 kPa: 16 %)", MARECHAL),
    "ecoflex_00_10_yeoh_tensile": PublishedSet(
        "ecoflex_00_10", Yeoh(c10=3569.69, c20=167.02, c30=-3.41165, poisson=0.499),
        "0.1..2.00", "own fit, relative rms 3.6 % (neo-Hookean mu=7.78 kPa: 12 %)", MARECHAL),
    "ecoflex_00_30_yeoh_tensile": PublishedSet(
        "ecoflex_00_30", Yeoh(c10=7156.83, c20=372.573, c30=-24.0781, poisson=0.499),
        "0.1..2.00", "own fit, relative rms 4.1 % (neo-Hookean mu=15.42 kPa: 9 %)", MARECHAL),
    "ecoflex_00_35_fast_yeoh_tensile": PublishedSet(
        "ecoflex_00_35_fast", Yeoh(c10=12548.9, c20=937.401, c30=-37.8007, poisson=0.499),
        "0.1..2.00", "own fit, relative rms 2.4 % (neo-Hookean mu=28.03 kPa: 15 %)", MARECHAL),
    "ecoflex_00_50_yeoh_tensile": PublishedSet(
        "ecoflex_00_50", Yeoh(c10=9687.69, c20=637.684, c30=-35.1511, poisson=0.499),
        "0.1..2.00", "own fit, relative rms 3.4 % (neo-Hookean mu=21.3 kPa: 12 %)", MARECHAL),
    "mold_star_16_fast_yeoh_tensile": PublishedSet(
        "mold_star_16_fast", Yeoh(c10=40575.6, c20=3444.74, c30=-87.6729, poisson=0.499),
        "0.1..2.00", "own fit, relative rms 1.0 % (neo-Hookean mu=91.95 kPa: 18 %)", MARECHAL),
    "mold_star_20t_yeoh_tensile": PublishedSet(
        "mold_star_20t", Yeoh(c10=53407.8, c20=4134.33, c30=-107.428, poisson=0.499),
        "0.1..2.00", "own fit, relative rms 1.1 % (neo-Hookean mu=120.2 kPa: 16 %)", MARECHAL),
    "platsil_gel_10_yeoh_tensile": PublishedSet(
        "platsil_gel_10", Yeoh(c10=25323.0, c20=4923.48, c30=-275.609, poisson=0.499),
        "0.1..2.00", "own fit, relative rms 3.0 % (neo-Hookean mu=61.12 kPa: 24 %)", MARECHAL),
    "psycho_paint_yeoh_tensile": PublishedSet(
        "psycho_paint", Yeoh(c10=58067.5, c20=3855.27, c30=-106.035, poisson=0.499),
        "0.1..2.00", "own fit, relative rms 1.2 % (neo-Hookean mu=129.2 kPa: 15 %)", MARECHAL),
    "rtv615_yeoh_tensile": PublishedSet("rtv615", Yeoh(c10=163529.0, c20=14177.7, c30=873.489, poisson=0.499),
        "0.1..1.50", "own fit, relative rms 1.1 % (neo-Hookean mu=365.9 kPa: 18 %)", MARECHAL),
    "rebound_25_yeoh_tensile": PublishedSet("rebound_25", Yeoh(c10=47085.3, c20=5514.56, c30=-209.378, poisson=0.499),
        "0.1..2.00", "own fit, relative rms 1.4 % (neo-Hookean mu=109.1 kPa: 20 %)", MARECHAL),
    "soloplast_150318_yeoh_tensile": PublishedSet(
        "soloplast_150318", Yeoh(c10=31956.6, c20=2659.28, c30=-109.274, poisson=0.499),
        "0.1..2.00", "own fit, relative rms 2.3 % (neo-Hookean mu=71.94 kPa: 16 %)", MARECHAL),
    "sortaclear_40_yeoh_tensile": PublishedSet(
        "sortaclear_40", Yeoh(c10=138157.0, c20=6109.52, c30=-66.9927, poisson=0.499),
        "0.1..2.00", "own fit, relative rms 0.6 % (neo-Hookean mu=300.9 kPa: 12 %)", MARECHAL),
    "wagnersil_20_nf_yeoh_tensile": PublishedSet(
        "wagnersil_20_nf", Yeoh(c10=53802.7, c20=10304.5, c30=-409.701, poisson=0.499),
        "0.1..2.00", "own fit, relative rms 1.7 % (neo-Hookean mu=130.2 kPa: 26 %)", MARECHAL),
    "diabase_x60_yeoh_tensile": PublishedSet(
        "diabase_x60", Yeoh(c10=939563.0, c20=-52400.2, c30=3380.86, poisson=0.499),
        "0.28..1.72", "own fit, relative rms 1.0 % (neo-Hookean mu=1513 kPa: 11 %)", SOROFORGE),
    "filaflex_60a_yeoh_tensile": PublishedSet(
        "filaflex_60a", Yeoh(c10=966567.0, c20=-60762.9, c30=3489.99, poisson=0.499),
        "0.28..1.88", "own fit, relative rms 1.8 % (neo-Hookean mu=1443 kPa: 15 %)", SOROFORGE),
    "filaflex_70a_yeoh_tensile": PublishedSet(
        "filaflex_70a", Yeoh(c10=1373330.0, c20=-94519.0, c30=5378.02, poisson=0.499),
        "0.28..1.88", "own fit, relative rms 1.7 % (neo-Hookean mu=1965 kPa: 17 %)", SOROFORGE),
    "hatchbox_tpu_yeoh_tensile": PublishedSet(
        "hatchbox_tpu", Yeoh(c10=4484370.0, c20=-423479.0, c30=25602.7, poisson=0.499),
        "0.28..1.97", "own fit, relative rms 6.0 % (neo-Hookean mu=5394 kPa: 24 %)", SOROFORGE),
    "matterhacker_hq_tpu_yeoh_tensile": PublishedSet(
        "matterhacker_hq_tpu", Yeoh(c10=3134630.0, c20=-352236.0, c30=25937.2, poisson=0.499),
        "0.28..1.72", "own fit, relative rms 4.3 % (neo-Hookean mu=3804 kPa: 23 %)", SOROFORGE),
    "cheetah_yeoh_tensile": PublishedSet("cheetah", Yeoh(c10=6222420.0, c20=-770198.0, c30=59809.8, poisson=0.499),
        "0.28..1.72", "own fit, relative rms 6.2 % (neo-Hookean mu=7263 kPa: 24 %)", SOROFORGE),
    "chinchilla_yeoh_tensile": PublishedSet(
        "chinchilla", Yeoh(c10=1367030.0, c20=-88170.1, c30=4913.82, poisson=0.499),
        "0.28..1.97", "own fit, relative rms 2.5 % (neo-Hookean mu=1990 kPa: 16 %)", SOROFORGE),
    "eel_yeoh_tensile": PublishedSet("eel", Yeoh(c10=5191400.0, c20=-482560.0, c30=27777.6, poisson=0.499),
        "0.28..1.99", "own fit, relative rms 6.1 % (neo-Hookean mu=6050 kPa: 25 %)", SOROFORGE),
    "ninjaflex_yeoh_tensile": PublishedSet("ninjaflex", Yeoh(c10=2407080.0, c20=-201118.0, c30=12902.0, poisson=0.499),
        "0.28..1.88", "own fit, relative rms 3.2 % (neo-Hookean mu=3267 kPa: 19 %)", SOROFORGE),
    "overture_hs_tpu_yeoh_tensile": PublishedSet(
        "overture_hs_tpu", Yeoh(c10=7067670.0, c20=-902204.0, c30=69401.2, poisson=0.499),
        "0.28..1.72", "own fit, relative rms 6.4 % (neo-Hookean mu=7953 kPa: 25 %)", SOROFORGE),
    "overture_tpu_yeoh_tensile": PublishedSet(
        "overture_tpu", Yeoh(c10=4382420.0, c20=-445630.0, c30=30417.2, poisson=0.499),
        "0.28..1.88", "own fit, relative rms 5.8 % (neo-Hookean mu=5429 kPa: 22 %)", SOROFORGE),
    "pi_etpu_yeoh_tensile": PublishedSet("pi_etpu", Yeoh(c10=6188010.0, c20=-590011.0, c30=41575.6, poisson=0.499),
        "0.28..1.79", "own fit, relative rms 6.1 % (neo-Hookean mu=8250 kPa: 20 %)", SOROFORGE),
    "polymaker_tpu90_yeoh_tensile": PublishedSet(
        "polymaker_tpu90", Yeoh(c10=3314180.0, c20=-324623.0, c30=19293.7, poisson=0.499),
        "0.28..1.97", "own fit, relative rms 5.7 % (neo-Hookean mu=3809 kPa: 26 %)", SOROFORGE),
    "sainsmart_tpu_yeoh_tensile": PublishedSet(
        "sainsmart_tpu", Yeoh(c10=2716550.0, c20=-253475.0, c30=15148.9, poisson=0.499),
        "0.28..1.97", "own fit, relative rms 5.8 % (neo-Hookean mu=3272 kPa: 24 %)", SOROFORGE),
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
"""Dict from name to set."""


def published(
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
        poisson: initial Poisson's ratio; None for that of the set.
        density: mass density [kg/m^3]; None for that of the set, if it has one.
        omega: shape factor for the ``relative`` policy; None for the law's own.

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

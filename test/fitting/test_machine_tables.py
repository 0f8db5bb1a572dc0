# SPDX-License-Identifier: Apache-2.0
"""Tensile tests as machines write them are read, and bad points decide nothing."""

from __future__ import annotations

import re
import time
from pathlib import Path

import numpy as np
import pytest
import yaml

from gdfe_ros import Simulation, load_scene
from gdfe_ros.cli import main
from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.csv_source import TableFile
from gdfe_ros.fitting.laws.tensile import fit_tensile
from gdfe_ros.materials import Law
from gdfe_ros.scene.schemas.machine_table import read_stress_table

CASES = Path(__file__).parents[1] / "data" / "cases" / "tensile"
YOUNG = 120e3
STRAIN = np.linspace(0.0, 2.0, 201)


def rubber(strain: np.ndarray) -> np.ndarray:
    """Return the nominal stress [Pa] of a neo-Hookean rubber."""
    return YOUNG / 3.0 * ((1.0 + strain) - (1.0 + strain) ** -2.0)


@pytest.mark.parametrize("name", ["plain", "german", "unit_row", "instron_raw", "nan_tail"])
@pytest.mark.parametrize("law", [Law.NEO_HOOKEAN, Law.OGDEN])
def test_the_cases_of_tables(name: str, law: Law) -> None:
    """120 000 Pa come back within 1 % from each layout."""
    table = read_stress_table(CASES / f"{name}.csv")
    assert fit_tensile(table.strain, table.stress, law=law).material.young0 == pytest.approx(YOUNG, rel=0.01)


def test_a_fitted_material_has_a_name_that_scenes_take(tmp_path: Path) -> None:
    """The material of a table named "2 sample-a.csv" loads in a scene."""
    (tmp_path / "2 sample-a.csv").write_bytes((CASES / "plain.csv").read_bytes())
    given = ["fit", "--tensile", str(tmp_path / "2 sample-a.csv"), "--law", "neo_hookean", "--out", str(tmp_path)]
    assert main(given) == 0
    materials = yaml.safe_load((tmp_path / "material.yaml").read_text())
    overrides = {"materials": materials, "regions": [{"material": "m_2_sample_a"}]}
    assert load_scene("bend5", overrides=overrides).name == "bend5"


@pytest.mark.parametrize("law", [Law.NEO_HOOKEAN, Law.OGDEN])
def test_the_case_of_slack_grips(law: Law) -> None:
    """120 000 Pa come back within 2 % from a test with 2 % of slack, which is told."""
    table = read_stress_table(CASES / "toe2.csv")
    fit = fit_tensile(table.strain, table.stress, law=law)
    assert fit.material.young0 == pytest.approx(YOUNG, rel=0.002)
    assert "slack: the specimen is taut from strain 0.02" in fit.notes[0]


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("law", [Law.NEO_HOOKEAN, Law.OGDEN])
def test_slack_scatter_and_spikes_are_found(seed: int, law: Law) -> None:
    """Slack of up to 8 %, scatter of up to 100 Pa and two spikes leave a modulus within 3 %, and a stable law."""
    rng = np.random.default_rng(seed)
    slack = float(rng.uniform(0.0, 0.08)) if seed % 3 else 0.0
    stress = rubber(np.maximum(STRAIN - slack, 0.0)) + rng.normal(0.0, rng.uniform(1.0, 100.0), STRAIN.size)
    if seed % 2:
        stress[rng.choice(np.arange(40, 200, 10), 2, replace=False)] += 3e4
    fit = fit_tensile(STRAIN, stress, law=law)
    assert fit.material.young0 == pytest.approx(YOUNG, rel=0.03)
    assert fit.remarks == ()
    assert any("slack" in text for text in fit.notes) == (slack > 0.0)
    assert any("far from their neighbours" in text for text in fit.notes) == bool(seed % 2)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_bad_points_at_the_foot_decide_nothing(count: int) -> None:
    """One to three points without stress at the foot of a smooth curve are left out, which is told."""
    stress = rubber(STRAIN)
    stress[1 : 1 + count] = 3.0
    fit = fit_tensile(STRAIN, stress, law=Law.OGDEN)
    assert fit.material.young0 == pytest.approx(YOUNG, rel=0.005)
    assert count == 1 or "points at the foot have hardly any stress" in fit.notes[0]


def test_unloading_and_later_cycles_are_left_out() -> None:
    """Only the first loading is fitted; the softer unloading and further cycles are told."""
    up, down = np.linspace(0.0, 1.0, 60), np.linspace(1.0, 0.0, 60)[1:]
    strain = np.concatenate([up, down, up[1:]])
    stress = np.concatenate([rubber(up), 0.6 * rubber(down), 0.7 * rubber(up[1:])])
    fit = fit_tensile(strain, stress, law=Law.NEO_HOOKEAN)
    assert fit.material.young0 == pytest.approx(YOUNG, rel=1e-3)
    assert "points of unloading or of later cycles are left out" in fit.notes[0]


def test_compression_has_no_slack() -> None:
    """A compression test is fitted as it is."""
    strain = np.linspace(0.0, -0.4, 60)
    fit = fit_tensile(strain, rubber(strain), law=Law.NEO_HOOKEAN)
    assert (fit.material.young0, fit.notes) == (pytest.approx(YOUNG, rel=1e-6), ())


@pytest.mark.parametrize("power", [1.0, 2.0, 3.0])
def test_a_curve_that_stiffens_is_not_called_slack(power: float) -> None:
    """Curves that begin soft, without a flat foot, are fitted as they are."""
    fit = fit_tensile(STRAIN, 1e4 * (STRAIN + STRAIN**2 * power), law=Law.CURVE)
    assert all("ribbon" in note for note in fit.notes)


def test_slack_can_be_given() -> None:
    """`slack` overrides what the data say."""
    table = read_stress_table(CASES / "toe2.csv")
    assert fit_tensile(table.strain, table.stress, law=Law.NEO_HOOKEAN, slack=0.0).notes == ()
    given = fit_tensile(table.strain, table.stress, law=Law.NEO_HOOKEAN, slack=0.02)
    assert given.material.young0 == pytest.approx(YOUNG, rel=1e-3)


def slack_table(slack: float, count: int, noise: float = 0.0, step: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return strains to 1.2 and stresses with a scatter of ``noise`` [Pa], rounded to multiples of ``step`` [Pa]."""
    strain = np.linspace(0.0, 1.2, count)
    stress = rubber(np.maximum(strain - slack, 0.0)) + np.random.default_rng(4).normal(0.0, noise, count)
    return strain, np.round(stress / step) * step if step else stress


@pytest.mark.parametrize(
    ("slack", "count", "noise", "step"),
    [(0.1, 500, 0, 0), (0.1, 61, 30, 100), (0.1, 80, 50, 0), (0.02, 61, 0, 0), (0.06, 45, 0, 0), (0.15, 31, 100, 0)],
)
def test_slack_of_ordinary_tables_is_found(slack: float, count: int, noise: float, step: float) -> None:
    """Slack of up to 15 % is subtracted from tables of 31 to 500 rows, with scatter and rounded stresses."""
    fit = fit_tensile(*slack_table(slack, count, noise, step), law=Law.NEO_HOOKEAN)
    assert fit.material.young0 == pytest.approx(YOUNG, rel=0.01)
    assert "slack: the specimen is taut from strain" in fit.notes[0]


@pytest.mark.parametrize(("slack", "count"), [(0.3, 61), (0.3, 200), (0.25, 9)])
def test_a_flat_start_that_is_not_subtracted_is_remarked(slack: float, count: int) -> None:
    """Long slack, and slack of a table with few rows, are not subtracted; `--slack` with the named strain mends it."""
    table = slack_table(slack, count)
    fit = fit_tensile(*table, law=Law.NEO_HOOKEAN)
    assert "the curve is flat up to strain" in fit.notes[0]
    named = float(re.search(r"`--slack (\S+)`", fit.notes[0])[1])
    assert fit_tensile(*table, law=Law.NEO_HOOKEAN, slack=named).material.young0 == pytest.approx(YOUNG, rel=0.07)


@pytest.mark.parametrize("count", [30, 60, 200])
@pytest.mark.parametrize("noise", [0.0, 100.0])
def test_a_curve_that_rises_late_is_not_cut(count: int, noise: float) -> None:
    """Nothing is subtracted from the J-shaped curve of Ogden's law with the exponent 9."""
    strain = np.linspace(0.0, 1.0, count)
    stress = 445.0 * ((1.0 + strain) ** 8 - (1.0 + strain) ** -5.5)
    stress += np.random.default_rng(1).normal(0.0, noise, count)
    assert not any("taut" in note for note in fit_tensile(strain, stress, law=Law.OGDEN, terms=1).notes)


ROWS = "0,0\n0.1,1\n0.2,2\n0.3,3\n0.4,4\n"
POINTS = [(0.0, 0.0), (0.1, 0.0109), (0.2, 0.0202), (0.3, 0.0283), (0.5, 0.0422)]
"""Strain and stress [MPa]."""


def table(head: str, row: str, *, comma: bool = False, tail: str = "") -> str:
    """Return the text of a table; ``row`` is the format of a line with the names e, p, s, n (fraction, %, MPa, N)."""
    numbers = [{"e": f"{e:.4f}", "p": f"{100 * e:.2f}", "s": f"{s:.6f}", "n": f"{12 * s:.6f}", "w": f"{25 * e:.3f}",
                "pa": f"{1e6 * s:.1f}"} for e, s in POINTS]  # fmt: skip
    lines = [row.format(**each) for each in numbers]
    body = "\n".join(lines)
    return f"{head}\n{body.replace('.', ',') if comma else body}\n{tail}"


SIZE = '"Width","6.0","mm"\n"Thickness","2.0","mm"\n"Length","25.0","mm"\n\n'
LAYOUTS = {
    "plain": table("strain,stress", "{e},{pa}"),
    "semicolons": table("Strain;Stress [MPa]", "{e};{s}", comma=True),
    "tabs": table("Strain (%)\tStress (MPa)", "{p}\t{s}"),
    "tabs, decimal commas": table("Dehnung\tSpannung\n%\tMPa", "{p}\t{s}", comma=True),
    "Zwick": table(
        '"Prüfer:";"NN"\n"Versuchsgeschwindigkeit";50;"mm/min"\n\n"Prüfzeit";"Standardweg";"Dehnung";"Spannung"\n'
        '"s";"mm";"%";"N/mm²"', "1,0;{w};{p};{s}", comma=True),
    "quoted decimal commas": table(
        '"Time","Tensile strain","Tensile stress"\n"(s)","(%)","(MPa)"', '"0.5","{p}","{s}"').replace(".", ","),
    "Instron": table(SIZE + '"Time","Extension","Load","Tensile strain (Extension)","Tensile stress"\n'
                     '"(s)","(mm)","(N)","(%)","(MPa)"', '"0.0","{w}","{n}","{p}","{s}"'),
    "Instron without stress": table(SIZE + "Time,Extension,Load\n(s),(mm),(N)", "0.0,{w},{n}"),
    "summary of results": table(
        '"Results"\n"","Tensile stress at Maximum Load [MPa]","Tensile strain at Break [%]"\n"1","0.0422","50"\n\n'
        '"Tensile strain [%]","Tensile stress [MPa]"', '"{p}","{s}"'),
    "footer": table("strain,stress\n(mm/mm),(MPa)", "{e},{s}", tail=",\nNaN,NaN\nend of test,\n"),
    "comments": "# made on Monday\n" + table("Strain;Stress", "{e};{pa}"),
    "units in names": table("engineering_strain,nominal_stress_Pa", "{e},{pa}"),
    "kilopascals": table("strain [-],stress [kPa]", "{e},{pa}").replace(".0\n", "e-3\n"),
}  # fmt: skip


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("encoding", ["utf-8-sig", "cp1252", "utf-16"])
def test_layouts_of_machines(tmp_path: Path, layout: str, encoding: str) -> None:
    """Every layout gives the same five points."""
    (tmp_path / "test.csv").write_bytes(LAYOUTS[layout].encode(encoding))
    found = read_stress_table(tmp_path / "test.csv")
    np.testing.assert_allclose(found.strain, [e for e, _ in POINTS], atol=1e-9)
    np.testing.assert_allclose(found.stress, [1e6 * s for _, s in POINTS], rtol=1e-4)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (2 * f"strain,stress\n{ROWS}", "has 2 tests, with headers in line 1, 7"),
        ("strain [%],stress [furlong]\n0,0\n1,1\n", "the unit 'furlong'; allowed: pa, n/m2, kpa"),
        ("strain,true stress [MPa]\n0,0\n1,1\n", "is no engineering stress; remedy: engineering strain and nominal"),
        ("strain,stress\n0,0\n1,\n2,2\n", "not two finite numbers in line 3"),
        ("time,load\n0,0\n1,1\n", r"the header is \['time', 'load'\]; allowed is a csv file"),
        ("strain,stress\n0,0\n\0", "it is no text"),
    ],
)  # fmt: skip
def test_what_is_ambiguous_is_refused(tmp_path: Path, text: str, told: str) -> None:
    """Several tests, unknown units, true stress and holes in the data are refused with a remedy."""
    (tmp_path / "test.csv").write_text(text)
    with pytest.raises(ValueError, match=told):
        read_stress_table(tmp_path / "test.csv")


def test_choices_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The command says which of several columns it takes, and what it leaves out."""
    path = tmp_path / "test.csv"
    path.write_text(table("strain (video),strain,stress [MPa]", "{e},9,{s}", tail="end,of,test\n"))
    assert main(["fit", "--tensile", str(path), "--law", "neo_hookean", "--out", str(tmp_path / "out")]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "2 columns of strain: the first, 'strain (video)', is used" in told
    assert "1 rows below the data are left out, the first: end, of, test" in told


def test_wrong_signs_have_no_stable_law() -> None:
    """Stresses against the strains are refused with a remedy."""
    with pytest.raises(GdfeError, match=r"no stable law of Ogden: .*check the signs"):
        fit_tensile(STRAIN[1:], -rubber(STRAIN[1:]), law=Law.OGDEN)


def test_choices_of_a_scene_are_remarks(tmp_path: Path) -> None:
    """A scene with `csv` reports which column it takes, and that a curve is exact in tension only."""
    (tmp_path / "test.csv").write_text(table("strain (video),strain,stress [MPa]", "{e},9,{s}"))
    (tmp_path / "scene.yaml").write_text(
        "name: cube\nmesh: {bar: {size: [0.02, 0.02, 0.02], cells: [1, 1, 1]}}\n"
        "materials: {skin: {law: curve, csv: test.csv, poisson: 0.45}}\nregions: [{material: skin}]\n"
        "handles: {base: {where: {face: x-}, fixed: true}}\n"
    )
    told = " ".join(Simulation(load_scene(tmp_path / "scene.yaml")).remarks())
    assert "2 columns of strain: the first, 'strain (video)', is used" in told
    assert "exact in uniaxial tension only" in told
    assert "20 % too low at stretch 1.25 and 50 % at 2" in told


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("," * 3_000_000, "has 3000001 columns; allowed: up to 1000"),
        ('strain,stress\n"' + "x" * 1_000_000, "cannot read .*: field larger than field limit"),
        ("strain,stress\n0.1," + "9" * 1_000_000, "cannot read .*: field larger than field limit"),
        ("x\n" * 1_000_000, "has 1000000 rows; allowed: up to 100000"),
        ("strain,stress\n" * 90_000, "has 90000 tests, with headers in line 1, 2, 3, 4, 5, 6, 7, 8, 9, 10; remedy"),
        ("force,x\n" * 90_000, r"line 1: the header is \['force', 'x'\]"),
    ],
    ids=["columns", "quote", "digits", "rows", "headers", "forces"],
)
def test_a_hostile_table_is_refused_soon(tmp_path: Path, text: str, told: str) -> None:
    """A table that is no test of a machine is refused within seconds of processor time, without a Python error."""
    path, started = tmp_path / "table.csv", time.process_time()
    path.write_text(text)
    with pytest.raises(ValueError, match=told):
        read_stress_table(path)
    assert time.process_time() - started < 20.0
    with pytest.raises(GdfeError, match=r"is no table|no rows of data|two columns|row \d+ has|no column"):
        TableFile(path).column("time")

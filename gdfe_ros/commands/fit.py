# SPDX-License-Identifier: Apache-2.0
"""``gdfe fit``: fit parameters of a scene to recordings of a robot, or a material to a tensile test."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from gdfe_ros.commands.options import add_workers, open_client
from gdfe_ros.commands.waiting import waiting
from gdfe_ros.errors import GdfeError
from gdfe_ros.untrusted.regular_file import path_inside
from gdfe_ros.untrusted.terminal import PlainConsole, make_table

LOSSES = ("linear", "soft_l1", "huber", "cauchy", "arctan")
LAWS = (
    "linear",
    "neo_hookean",
    "stable_neo_hookean",
    "mooney_rivlin",
    "yeoh",
    "arruda_boyce",
    "gent",
    "ogden",
    "curve",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("scene", nargs="?", help="a name in config/scenes or the path of a YAML file")
    parser.add_argument(
        "data", nargs="*", type=Path, metavar="DATA", help="recordings: CSV files and directories of bags"
    )
    parser.add_argument(
        "--match",
        type=Path,
        metavar="FILE.yaml",
        help="assigns columns and topics of the recordings to probes, handles and actuators of the scene",
    )
    parser.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="KEY=LOW..HIGH",
        help="fit this key of the scene within these bounds; LOW..START..HIGH also gives the start value",
    )
    parser.add_argument(
        "--holdout", nargs="+", default=[], metavar="NAME", help="recordings that are predicted but not fitted"
    )
    parser.add_argument(
        "--loss",
        choices=LOSSES,
        default="linear",
        help="loss function of the residuals (default: linear, the sum of their squares)",
    )
    add_workers(parser)
    parser.add_argument("--out", type=Path, metavar="DIR", help="directory for the results (default: <name>_fit)")
    tensile = parser.add_argument_group("a material from a tensile test")
    tensile.add_argument(
        "--tensile",
        type=Path,
        metavar="CURVE.csv",
        help="table of a testing machine: strain and stress, or force, extension and size",
    )
    tensile.add_argument(
        "--law", choices=LAWS, default="ogden", help="law that is fitted to the curve (default: ogden)"
    )
    tensile.add_argument(
        "--terms", type=int, help="number of terms of Ogden's law (default: the fewest that fit well and are stable)"
    )
    tensile.add_argument("--degree", type=int, default=6, help="degree of the polynomial of the law curve (default: 6)")
    tensile.add_argument(
        "--poisson", type=float, default=0.499, help="Poisson's ratio of the material (default: 0.499)"
    )
    tensile.add_argument(
        "--slack", type=float, help="strain at which the specimen becomes taut (default: found in the data; 0: none)"
    )
    tensile.add_argument("--density", type=float, help="density of the material [kg/m^3]")


def run(arguments: argparse.Namespace) -> int:
    """Fit a scene or a material and write the results; return 0."""
    if arguments.tensile is not None:
        if arguments.scene or arguments.vary:
            raise GdfeError("--tensile cannot be combined with a scene and recordings; remedy: leave out one of them")
        return _fit_tensile(arguments)
    if not arguments.scene or not arguments.data:
        raise GdfeError(
            "give a scene and recordings, as: gdfe fit SCENE DATA... --vary KEY=LOW..HIGH; or --tensile FILE"
        )
    return _fit_scene(arguments)


def _fit_tensile(arguments: argparse.Namespace) -> int:
    from gdfe_ros.fitting.laws.tensile import draw_tensile, fit_tensile, material_text, tensile_remarks, tensile_rows
    from gdfe_ros.materials import Law
    from gdfe_ros.scene.schemas.machine_table import read_stress_table

    curve = read_stress_table(arguments.tensile)
    fit = fit_tensile(
        curve.strain,
        curve.stress,
        law=Law[arguments.law.upper()],
        terms=arguments.terms,
        degree=arguments.degree,
        poisson=arguments.poisson,
        density=arguments.density,
        slack=arguments.slack,
    )
    name = arguments.tensile.stem
    out = arguments.out or Path(f"{name}_fit")
    out.mkdir(parents=True, exist_ok=True)
    console = PlainConsole(soft_wrap=True)
    console.print(make_table(f"{arguments.tensile}: {len(fit.strain)} points", rows=tensile_rows(fit)))
    for text in [*curve.remarks, *tensile_remarks(fit)]:
        console.print(f"note: {text}", style="yellow", highlight=False)
    (out / "material.yaml").write_text(material_text(fit, name), encoding="utf-8")
    draw_tensile(out / "tensile.png", fit, title=name)
    console.print(f"written  {out / 'material.yaml'}, {out / 'tensile.png'}")
    return 0


def _fit_scene(arguments: argparse.Namespace) -> int:
    from gdfe_ros.analysis.difference_table import wide_console
    from gdfe_ros.fitting.fit import fit_scene, read_recordings, split_held_out
    from gdfe_ros.fitting.fit_report import write_fit
    from gdfe_ros.fitting.fitted_parameter import read_parameters
    from gdfe_ros.scene import load_scene

    started = time.perf_counter()
    with waiting(f"loading {arguments.scene}"):
        scene = load_scene(arguments.scene)
    parameters = read_parameters(arguments.vary, scene)
    recordings = read_recordings(arguments.data, arguments.match, scene)
    fitted, held_out = split_held_out(recordings, arguments.holdout)
    console = wide_console()
    count = sum(recording.count for recording in fitted)
    recordings_of = "1 recording" if len(fitted) == 1 else f"{len(fitted)} recordings"
    console.print(f"fitted: {recordings_of} with {count} values; held out: {len(held_out)}", highlight=False)
    for recording in recordings:
        for text in recording.remarks:
            console.print(f"{recording.name}: {text}", highlight=False)
    starts = ", ".join(f"{parameter.key} = {parameter.start:.4g}" for parameter in parameters)
    with open_client(arguments) as client, waiting(f"simulating and searching, from {starts}"):
        fit = fit_scene(
            scene,
            fitted,
            parameters,
            client=client,
            held_out=held_out,
            loss=arguments.loss,
            report=lambda text: console.print(text, highlight=False),
        )
    _print(console, fit, time.perf_counter() - started)
    out = arguments.out or path_inside(Path(), f"{scene.name}_fit")
    console.print(f"written  {', '.join(str(path) for path in write_fit(out, fit))}", highlight=False)
    return 0


def _print(console: PlainConsole, fit: object, elapsed: float) -> None:
    """Print values, misfits and warnings."""
    from gdfe_ros.fitting.fit_report import NOT_INCLUDED, match_rows, own_rows, parameter_rows

    heads = ("key", "value", "95 % interval", "correlations with those above")
    console.print(make_table("parameters", heads, parameter_rows(fit), fold=True))
    console.print(NOT_INCLUDED, highlight=False)
    heads = ("recording", "series", "", "values", "misfit, rms", "of the motion")
    console.print(make_table("measured and simulated", heads, match_rows(fit), fold=True))
    for name, text in own_rows(fit):
        console.print(f"{name}: {text}", highlight=False)
    for text in fit.warnings:
        console.print(f"warning: {text}", style="yellow", highlight=False)
    console.print(f"{fit.simulations} simulations in {elapsed:.3g} s", highlight=False)

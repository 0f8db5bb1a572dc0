# SPDX-License-Identifier: Apache-2.0
"""Recordings from CSV files and bags, and a scene fitted to them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares

from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.comparison import first_own
from gdfe_ros.fitting.csv_source import CsvSource
from gdfe_ros.fitting.fitted_parameter import FittedParameter
from gdfe_ros.fitting.match import Source, find_sources
from gdfe_ros.fitting.problem import FitPoint, FitProblem, Solved, require_motion, solve
from gdfe_ros.fitting.recording import ROW, TIME, Recording, Schedule, make_schedule, require_commanded
from gdfe_ros.fitting.statistics import Confidence, Match, confidence, matches, require_bounds, warnings
from gdfe_ros.fitting.trajectory import Simulations, require_simulated
from gdfe_ros.scene import Scene, scene_from_text

if TYPE_CHECKING:
    from distributed import Client


def read_recordings(data: Sequence[Path], match: Path | None, scene: Scene) -> list[Recording]:
    """Return the recordings in CSV files and bags.

    Args:
        data: paths of the files and bags.
        match: YAML file that assigns columns and topics to quantities; None: the names of the scene assign them.
        scene: scene with which the recordings are compared.

    Raises:
        GdfeError: a file, a column, a topic or a name does not exist, or the match file has a defect.
    """
    return [_read(source, scene) for source in find_sources(data, match)]


def split_held_out(recordings: Sequence[Recording], names: Sequence[str]) -> tuple[list[Recording], list[Recording]]:
    """Return the recordings to fit and the recordings that are held out.

    Raises:
        GdfeError: there is no recording with one of the names.
    """
    known = [recording.name for recording in recordings]
    if unknown := [name for name in names if name not in known]:
        raise GdfeError(f"--holdout {', '.join(unknown)}: there is no such recording; recordings: {', '.join(known)}")
    held = [recording for recording in recordings if recording.name in names]
    return [recording for recording in recordings if recording.name not in names], held


def _read(source: Source, scene: Scene) -> Recording:
    match = source.match
    if match.set:
        scene = scene_from_text(scene.source, origin=f"of recording {source.name}", overrides=match.set)
    schedule: Schedule | None = None
    remarks: tuple[str, ...] = ()
    over = TIME
    if source.path.suffix.lower() in (".csv", ".tsv", ".txt"):
        file = CsvSource(source, scene)
        series, tracks, over = file.series(), file.tracks(), TIME if file.timed else ROW
    else:
        from gdfe_ros.fitting.bag_source import read_bag  # mcap, for bags only

        series, tracks, schedule, remarks = read_bag(source, scene)
    require_commanded(tracks, scene, f"recording {source.name}")
    if schedule is None:
        reach = min(match.shift, *(match.shift_between or (match.shift,)))
        moments = np.concatenate([item.times for item in series])
        schedule = make_schedule(tracks, scene, moments if scene.dynamics is None else moments - reach)
    return Recording(
        name=source.name,
        series=series,
        schedule=schedule,
        overrides=match.set,
        shift=match.shift,
        shift_between=match.shift_between,
        frame=0 if match.frame is None else 6 if match.frame.fit == "pose" else 3,
        from_equilibrium=match.start == "equilibrium",
        remarks=remarks,
        over=over,
    )


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of a fit.

    Attributes:
        scene: scene with the fitted values.
        problem: least-squares problem of the fitted recordings.
        solved: solution of this problem.
        known: confidence intervals and correlations of the parameters.
        held_out: problem of the recordings that were held out; None if there are none.
        prediction: simulation of the recordings that were held out; None if there are none.
        matches: agreement with every series; fitted series come first.
        warnings: warnings about the fit, one line each.
        simulations: number of simulations that the fit needed.
    """

    scene: Scene
    problem: FitProblem
    solved: Solved
    known: Confidence
    held_out: FitProblem | None
    prediction: FitPoint | None
    matches: tuple[Match, ...]
    warnings: tuple[str, ...]
    simulations: int


def fit_scene(
    scene: Scene,
    recordings: Sequence[Recording],
    parameters: Sequence[FittedParameter],
    *,
    client: Client | None = None,
    held_out: Sequence[Recording] = (),
    loss: str = "linear",
    report: Callable[[str], None] | None = None,
) -> Fit:
    """Fit parameters of a scene to recordings.

    Args:
        scene: scene to fit; it is not modified.
        recordings: recordings to fit.
        parameters: parameters to fit.
        client: client of the workers (`gdfe_ros.analysis.workers.connect`); None simulates in this process.
        held_out: recordings that are only predicted.
        loss: loss of scipy's `least_squares`: linear, soft_l1, huber, cauchy or arctan.
        report: function that is called with a line of text after each search.

    Raises:
        GdfeError: the data contain no information, a parameter has no influence, a bound has the wrong unit, or the
            initial values cannot be simulated.
    """
    if not recordings:
        raise GdfeError("every recording is held out: nothing is left to fit; remedy: hold out fewer")
    for recording in (*recordings, *held_out):
        require_motion(recording, scene.mesh.size)
    simulations, quads = Simulations(scene.source, client), scene.mesh.boundary.quads
    problem = FitProblem(simulations, parameters, recordings, quads=quads)
    solved = solve(problem, moves=scene.dynamics is not None, loss=loss, report=report)
    known = confidence(problem, solved)
    require_bounds(problem, solved, known)
    values = {estimate.key: estimate.value for estimate in known.estimates}
    fitted = matches(problem, solved.point)
    other, point, predicted = None, None, []
    if held_out:
        other = FitProblem(simulations, parameters, held_out, quads=quads)
        point = predict(other, solved.point.values)
        predicted = matches(other, point, held_out=True)
    return Fit(
        scene=scene_from_text(scene.source, origin="that was fitted", overrides=values),
        problem=problem,
        solved=solved,
        known=known,
        held_out=other,
        prediction=point,
        matches=(*fitted, *predicted),
        warnings=(*warnings(fitted, predicted, known, parameters), *_list_unconverged(solved.point, problem)),
        simulations=simulations.count,
    )


def predict(problem: FitProblem, values: tuple[float, ...]) -> FitPoint:
    """Simulate recordings with given parameter values; only the time shifts and frames of the recordings are fitted.

    Raises:
        NotSimulatedError: a recording cannot be simulated.
    """
    trajectories = require_simulated(problem.trajectories(values))
    own = [first_own(recording, item) for recording, item in zip(problem.recordings, trajectories, strict=True)]
    counts = np.cumsum([0, *(len(each) for each in own)])
    if counts[-1]:
        low, high = (ends[len(problem.parameters) :] for ends in problem.bounds())

        def parts(unknowns: np.ndarray) -> list[np.ndarray]:
            return [unknowns[first:last] for first, last in pairwise(counts)]

        start = np.clip(np.concatenate(own), low, high)
        found = least_squares(lambda u: problem.stack_residuals(trajectories, parts(u)), start, bounds=(low, high))
        own = parts(found.x)
    return FitPoint(values, tuple(own), tuple(trajectories))


def _list_unconverged(point: FitPoint, problem: FitProblem) -> list[str]:
    pairs = zip(problem.recordings, point.trajectories, strict=True)
    return [
        f"{recording.name}: {item.not_converged} of {len(item.times)} steps did not converge"
        for recording, item in pairs
        if item.not_converged
    ]

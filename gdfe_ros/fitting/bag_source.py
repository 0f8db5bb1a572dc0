# SPDX-License-Identifier: Apache-2.0
"""Recordings in bags: bags of this package's node, and bags with a robot's own topics."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.analysis.bag_run import BagRun, BagStep, BagSteps
from gdfe_ros.analysis.replay import command_of
from gdfe_ros.constraints import Pose, nearest_turn
from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.bag_topics import TopicValues
from gdfe_ros.fitting.match import CommandModel, CompareModel, Source, along_of, match_observable, scale_of
from gdfe_ros.fitting.recording import CLOUDS, Observable, QuantityKind, Schedule, Series, Track, constant
from gdfe_ros.recording.foreign_bag import open_bag
from gdfe_ros.recording.step import Begin
from gdfe_ros.scene.scene import Scene

MOST_POINTS = 400
"""Largest number of points that are used from a cloud on the surface. A larger cloud is thinned evenly, because more
points hardly improve the fit of a few parameters."""
Bag = tuple[tuple[Series, ...], tuple[Track, ...], Schedule | None, tuple[str, ...]]
"""Result of `read_bag`: series, tracks of commands, schedule, remarks."""


def read_bag(source: Source, scene: Scene) -> Bag:
    """Return the measured series and the commands of a bag.

    In a bag of the node, the step records contain the commands. If the match file compares nothing, the probes are
    compared, or the mesh if there are no probes. For any other bag, the match file names the topics. Times are the
    stamps of the headers, or the recording times of messages without a header. Time 0 is the first message that is
    used. If the stamps of a topic go back, as after a restart, the bag is read up to there, with a remark.

    Returns:
        Series; tracks of commands; schedule of the steps for a bag of the node, else None; remarks.

    Raises:
        GdfeError: a topic, or a requested item of its messages, does not exist.
    """
    match = source.match
    reader = open_bag(source.path)
    values = TopicValues(reader)
    if reader.run is not None and not match.commands:
        series, schedule, remarks = _own(source, scene)
        if match.compare:
            values.start([*match.compare.values()])  # to leave out what follows a restart
            series = tuple(_series(source, scene, values, name, model, 0.0) for name, model in match.compare.items())
        return series, (), schedule, remarks or values.remarks
    if not match.compare:
        topics = ", ".join(sorted(reader.topics))
        raise GdfeError(f"bag {source.path}: nothing is compared; remedy: `compare` in a match file; topics: {topics}")
    models = (*match.compare.values(), *match.commands.values())
    start = values.start([each for each in models if isinstance(each, CompareModel | CommandModel)])
    tracks = tuple(_track(source, values, name, model, start) for name, model in match.commands.items())
    series = tuple(_series(source, scene, values, name, model, start) for name, model in match.compare.items())
    return series, tracks, None, values.remarks


def _series(source: Source, scene: Scene, values: TopicValues, name: str, model: CompareModel, start: float) -> Series:
    where = f"recording {source.name}, {name}"
    observable = match_observable(model, scene, where)
    if not model.topic:
        raise GdfeError(f"{where}: no topic is named; topics: {', '.join(values.names)}")
    labels, along = along_of(model, observable, where)
    factor, every = scale_of(model.unit), source.match.every
    if observable.kind in CLOUDS:
        times, clouds = values.clouds(model, where)
        found = _cloud_values(observable, clouds[::every], scene, where)
    else:
        times, found = values.of(model, where)
        found = _components(found[::every], along, model.topic, where)
    sigma = model.sigma and model.sigma * factor
    return Series(name, observable, times[::every] - start, factor * found, labels, along, sigma)


def _components(
    found: NDArray[np.float64], along: NDArray[np.float64] | None, topic: str, where: str
) -> NDArray[np.float64]:
    """Return the components (m, c) of m vectors along the c directions ``along`` (c, 3), or m single numbers (m, 1).

    Raises:
        GdfeError: a message has one number where a vector is needed, or a vector where one number is needed.
    """
    if found.shape[1] >= 3:
        if along is None:
            raise GdfeError(f"{where}: topic {topic} has vectors; an actuator has one number: name another topic")
        return found[:, :3] @ along.T
    if along is not None and len(along) > 1:
        raise GdfeError(f"{where}: topic {topic} has one number a message; along what? give `along: [x, y, z]`")
    return found[:, :1]


def _cloud_values(
    observable: Observable, clouds: list[NDArray[np.float64]], scene: Scene, where: str
) -> NDArray[np.float64]:
    """Return the points of m clouds: (m, 3 n) for clouds of all n vertices, or (m, p, 3) for points on the surface.

    A cloud with fewer than p points is filled with NaN.
    """
    if observable.kind is QuantityKind.VERTICES:
        counts = {len(cloud) for cloud in clouds}
        if counts != {scene.mesh.n_vertices}:
            text = f"its clouds have {sorted(counts)} points, and the scene has {scene.mesh.n_vertices} vertices"
            raise GdfeError(f"{where}: {text}; remedy: cloud: surface")
        return np.array([cloud.ravel() for cloud in clouds])
    most = min(MOST_POINTS, max(len(cloud) for cloud in clouds))
    found = np.full((len(clouds), most, 3), np.nan)
    for row, cloud in enumerate(clouds):
        chosen = cloud[np.linspace(0, len(cloud) - 1, min(most, len(cloud))).round().astype(int)]
        found[row, : len(chosen)] = chosen
    return found


def _track(source: Source, values: TopicValues, name: str, model: float | CommandModel, start: float) -> Track:
    if not isinstance(model, CommandModel):
        return constant(name, model)
    where = f"recording {source.name}, command of {name}"
    if not model.topic:
        raise GdfeError(f"{where}: no topic is named; topics: {', '.join(values.names)}")
    times, found = values.of(model, where, pose=True)
    for before, row in pairwise(found[:, 3:]) if found.shape[1] == 6 else ():  # rotation vectors go on beyond pi
        row[:] = nearest_turn(Rotation.from_rotvec(row).as_quat(), Pose(rotation=before))
    factor = np.ones(found.shape[1])
    factor[:3] = scale_of(model.unit)
    return Track(name, times - start, found * factor, held=True)


def _own(source: Source, scene: Scene) -> tuple[tuple[Series, ...], Schedule, tuple[str, ...]]:
    """Return series, schedule and remarks of a node's bag, from the initial state to the first gap in its steps."""
    run = BagRun(source.path)
    probes = [name for name in scene.probes if f"probe/{name}" in run.roles]
    topics = [f"probe/{name}" for name in probes] or ["mesh"]
    steps, remarks = _from_rest(run, topics)
    schedule = Schedule(
        np.array([step.record.time for step in steps]), tuple(command_of(step.record) for step in steps)
    )
    compared = [step for step in steps if all(topic in step.samples for topic in topics)][:: source.match.every]
    times = np.array([step.record.time for step in compared])
    if probes:
        given = {"labels": tuple("xyz"), "along": np.eye(3)}
        series = [Series(n, Observable(QuantityKind.PROBE, n), times, _positions(compared, n), **given) for n in probes]
    else:
        clouds = [np.stack([step.samples["mesh"][axis] for axis in "xyz"], axis=1) for step in compared]
        observable = Observable(QuantityKind.VERTICES)
        found = _cloud_values(observable, [cloud.astype(np.float64) for cloud in clouds], scene, f"bag {source.path}")
        series = [Series("mesh", observable, times, found, ("",))]
    return tuple(series), schedule, remarks


def _from_rest(run: BagRun, topics: list[str]) -> tuple[list[BagStep], tuple[str, ...]]:
    """Return the steps from the initial state to the first gap, and a remark about the gap if there is one."""
    steps: list[BagStep] = []
    for step in BagSteps(run, topics=topics):
        if not steps and step.record.begin is not Begin.REST:
            raise GdfeError(
                f"bag {run.reader.path} does not begin in the initial state; "
                "remedy: record from the activation or a reset on"
            )
        if steps and (step.record.begin is not Begin.LAST or step.record.step != steps[-1].record.step + 1):
            return steps, (
                f"read only up to t = {steps[-1].record.time:g} s, where the run was restarted or steps are missing",
            )
        steps.append(step)
    if not steps:
        raise GdfeError(f"bag {run.reader.path} holds no step: there is nothing to fit")
    return steps, ()


def _positions(steps: list[BagStep], probe: str) -> NDArray[np.float64]:
    fields = [f"pose.position.{axis}" for axis in "xyz"]
    return np.array([[float(step.samples[f"probe/{probe}"][name][0]) for name in fields] for step in steps])

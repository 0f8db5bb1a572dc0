# SPDX-License-Identifier: Apache-2.0
"""Recordings from CSV files and bags."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.csv_source import CsvSource
from gdfe_ros.fitting.match import Source, find_sources
from gdfe_ros.fitting.recording import ROW, TIME, Recording, Schedule, make_schedule, require_commanded
from gdfe_ros.scene import Scene, scene_from_text


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

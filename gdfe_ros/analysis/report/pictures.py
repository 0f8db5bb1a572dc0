# SPDX-License-Identifier: Apache-2.0
"""Pictures of a run: of the step with the largest strain, and of evenly spaced steps."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gdfe_ros.analysis.bag_run import BagRun, BagStep, BagSteps
from gdfe_ros.analysis.difference_table import unit_of
from gdfe_ros.analysis.picture import draw_body
from gdfe_ros.analysis.scenery import Scenery
from gdfe_ros.errors import RecordingError
from gdfe_ros.scene import Scene

SECONDS = 4
"""Duration of an animation [s]."""
_QUALITY = "18"
"""Constant rate factor of H.264, without visible loss."""


def write_gif(pictures: Sequence[Image.Image], path: Path) -> Path:
    """Write a GIF that repeats forever.

    Raises:
        OSError: the file cannot be written.
    """
    first, *others = (picture.convert("P", palette=Image.Palette.ADAPTIVE) for picture in pictures)
    duration = round(1000 * SECONDS / len(pictures))
    first.save(path, save_all=True, append_images=others, duration=duration, loop=0)
    return path


def write_mp4(pictures: Sequence[Image.Image], path: Path) -> Path:
    """Write an H.264 video for browsers and slides; they require even sizes, so an odd last row or column is dropped.

    Raises:
        ModuleNotFoundError: PyAV is not installed.
        OSError: the file cannot be written.
    """
    import av  # of the extra `video`

    width, height = (side // 2 * 2 for side in pictures[0].size)
    with av.open(str(path), "w", format="mp4") as container:
        stream = container.add_stream("libx264", rate=Fraction(len(pictures), SECONDS), options={"crf": _QUALITY})
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        for picture in pictures:
            container.mux(stream.encode(av.VideoFrame.from_image(picture.crop((0, 0, width, height)))))
        container.mux(stream.encode())
    return path


STRAIN = "eps_eq"
"""Field whose largest value decides which step `write_png` draws."""


@dataclass(frozen=True, eq=False)
class Shown:
    """Data of a drawn step.

    Attributes:
        time: simulation time [s].
        mark: text behind the title; empty if the step converged.
        positions: positions of the vertices (n, 3) [m].
        values: values of the cells (m,).
        scenery: obstacles, cables, chambers and contact forces.
    """

    time: float
    mark: str
    positions: NDArray[np.float64]
    values: NDArray[np.float64]
    scenery: Scenery


def write_png(bag: str | Path, path: Path, *, field: str = STRAIN) -> Path:
    """Draw the step with the largest eps_eq, coloured by a field of the cells.

    Raises:
        RecordingError: the bag has no mesh or no such field.
        OSError: the file cannot be written.
    """
    run = BagRun(bag)
    most = max(_steps(run), key=lambda step: step.samples["strain"].get(STRAIN, np.zeros(1)).max(), default=None)
    if most is None:
        raise _nothing(run)
    shown = _gather(most, run.scene, field)
    given = {"title": f"{run.scene.name} at t = {shown.time:g} s, the largest strain{shown.mark}"}
    given |= {"label": _label(field), "scenery": shown.scenery}
    draw_body(path, run.scene.mesh, shown.positions, shown.values, **given)
    return path


def draw_steps(bag: str | Path, *, field: str = STRAIN, frames: int = 40) -> Iterator[Image.Image]:
    """Yield pictures of ``frames`` evenly spaced steps, with one colour scale and one length scale.

    Raises:
        RecordingError: the bag has no mesh or no such field, or no frame is requested.
    """
    if frames < 1:
        raise RecordingError(f"{frames} frames are asked for; allowed: 1 or more")
    run = BagRun(bag)
    count = len(run.records)
    wanted = set(np.linspace(0 if frames > 1 else count - 1, count - 1, frames).round().astype(int).tolist())
    chosen = [_gather(step, run.scene, field) for step in _steps(run, wanted)]
    if not chosen:
        raise _nothing(run)
    limits = min(float(s.values.min()) for s in chosen), max(float(s.values.max()) for s in chosen)
    corners = np.array([corner for s in chosen for corner in (s.positions.min(axis=0), s.positions.max(axis=0))])
    for shown in chosen:
        buffer, title = BytesIO(), f"{run.scene.name} at t = {shown.time:.3f} s{shown.mark}"
        given = {"title": title, "label": _label(field), "limits": limits, "around": corners}
        draw_body(buffer, run.scene.mesh, shown.positions, shown.values, **given, scenery=shown.scenery)
        yield Image.open(buffer).convert("RGB")


def _steps(run: BagRun, wanted: Collection[int] | None = None) -> Iterator[BagStep]:
    """Yield the steps with a mesh and strains; if ``wanted`` is given, only the steps with these indices."""
    around = [topic for topic in Scenery.topics(run.scene) if topic in BagSteps(run).topics]
    for number, step in enumerate(BagSteps(run, topics=["mesh", "strain", *around])):
        if (wanted is None or number in wanted) and {"mesh", "strain"} <= step.samples.keys():
            yield step


def _nothing(run: BagRun) -> RecordingError:
    return RecordingError(f"bag {run.reader.path} holds no step with a mesh and strains: there is nothing to draw")


def _gather(step: BagStep, scene: Scene, field: str) -> Shown:
    strain = step.samples["strain"]
    if field not in strain:
        raise RecordingError(f"the bag has no field {field!r} of the cells; it has {', '.join(strain)}")
    positions = np.stack([step.samples["mesh"][axis] for axis in "xyz"], axis=1).astype(np.float64)
    scenery = Scenery.from_samples(scene, step.samples, positions)
    mark = "" if step.record.converged else ", not converged"
    return Shown(step.record.time, mark, positions, strain[field].astype(np.float64), scenery)


def _label(field: str) -> str:
    name = "equivalent strain" if field == STRAIN else field
    unit = unit_of(field)
    return f"{name} [{unit}]" if unit else name

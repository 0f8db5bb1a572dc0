# SPDX-License-Identifier: Apache-2.0
"""Pictures of a run: of its end, and of evenly spaced steps."""

from __future__ import annotations

from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.analysis.bag_steps import BagStep, BagSteps
from gdfe_ros.analysis.difference_table import unit_of
from gdfe_ros.analysis.picture import draw_body
from gdfe_ros.errors import RecordingError


def write_png(bag: str | Path, path: Path, *, field: str = "eps_eq") -> Path:
    """Draw the last step with a mesh, coloured by a field of the cells.

    Raises:
        RecordingError: the bag has no mesh or no such field.
        OSError: the file cannot be written.
    """
    run = BagRun(bag)
    time, positions, values = _all(run, field, frames=1)[-1]
    draw_body(path, run.mesh, positions, values, title=f"{run.scene.name} at t = {time:g} s", label=_label(field))
    return path


def draw_steps(bag: str | Path, *, field: str = "eps_eq", frames: int = 40) -> Iterator[Image.Image]:
    """Yield pictures of ``frames`` evenly spaced steps, with one colour scale and one length scale.

    Raises:
        RecordingError: the bag has no mesh or no such field, or no frame is requested.
    """
    if frames < 1:
        raise RecordingError(f"{frames} frames are asked for; allowed: 1 or more")
    run = BagRun(bag)
    shown = _all(run, field, frames=frames)
    limits = min(float(v.min()) for *_, v in shown), max(float(v.max()) for *_, v in shown)
    corners = np.array([corner for _, places, _ in shown for corner in (places.min(axis=0), places.max(axis=0))])
    for time, positions, values in shown:
        buffer, title = BytesIO(), f"{run.scene.name} at t = {time:.3f} s"
        label, mesh = _label(field), run.mesh
        draw_body(buffer, mesh, positions, values, title=title, label=label, limits=limits, around=corners)
        yield Image.open(buffer).convert("RGB")


def _all(run: BagRun, field: str, *, frames: int) -> list[tuple[float, NDArray[np.float64], NDArray[np.float64]]]:
    """Return time [s], positions [m] and values of evenly spaced steps, including the last one."""
    count = len(run.records)
    wanted = set(np.linspace(0 if frames > 1 else count - 1, count - 1, frames).round().astype(int).tolist())
    found = [_frame(step, field) for step in _chosen(run, wanted)]
    if not found:
        raise RecordingError(f"bag {run.reader.path} holds no step with a mesh and strains: there is nothing to draw")
    return found


def _chosen(run: BagRun, wanted: set[int]) -> Iterator[BagStep]:
    for number, step in enumerate(BagSteps(run, topics=["mesh", "strain"])):
        if number in wanted and {"mesh", "strain"} <= step.samples.keys():
            yield step


def _frame(step: BagStep, field: str) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    strain = step.samples["strain"]
    if field not in strain:
        raise RecordingError(f"the bag has no field {field!r} of the cells; it has {', '.join(strain)}")
    positions = np.stack([step.samples["mesh"][axis] for axis in "xyz"], axis=1).astype(np.float64)
    return step.record.time, positions, strain[field].astype(np.float64)


def _label(field: str) -> str:
    name = "equivalent strain" if field == "eps_eq" else field
    unit = unit_of(field)
    return f"{name} [{unit}]" if unit else name

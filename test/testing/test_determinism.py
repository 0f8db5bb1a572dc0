# SPDX-License-Identifier: Apache-2.0
"""A controlled run, made twice in fresh processes, gives bags with the same bits."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from gdfe_ros.constraints import Pose
from gdfe_ros.simulation import Command
from gdfe_ros.testing import PublishedState, Simulator

COARSE = {"mesh.bar.cells": [10, 2, 2]}


def _controller(state: PublishedState) -> Command:
    """Follow a moving height with feedback of strain and displacement, so that every published array matters."""
    goal = 0.1 * np.sin(2.0 * state.time)
    height = state.poses["tip"].translation[2] + 0.3 * (goal - float(state.displacements[-1, 2]))
    return Command(handles={"tip": Pose((0.0, 1e-3 * float(state.strain[0, 3]), height))})


def _contents(bag: Path) -> dict[str, list[bytes]]:
    """Return a dict from topic to the numbers of its messages; their bytes differ in CDR's undefined padding."""
    contents = defaultdict(list)
    with AnyReader([bag]) as reader:
        for connection, moment, raw in reader.messages():
            topic, message = (
                connection.topic.split("/", 2)[2].removeprefix("gdfe_sim/"),
                reader.deserialize(raw, connection.msgtype),
            )
            if topic in ("mesh", "strain", "topology"):
                contents[topic].append((moment, message.data.tobytes()))
            elif topic != "step_record":
                contents[topic].append((moment, repr(message)))
    return contents


@pytest.mark.parametrize("steps", [100, pytest.param(5000, marks=pytest.mark.slow)])
def test_two_runs_leave_the_same_arrays(tmp_path: Path, steps: int) -> None:
    """Two bags have the same mesh, strain, poses, wrenches and commands, bit for bit."""
    contents = []
    for run in ("first", "second"):
        with Simulator("bend5", overrides=COARSE, bag=tmp_path / run) as simulator:
            simulator.run(_controller, steps=steps)
        contents.append(_contents(tmp_path / run))
    first, second = contents
    assert len(first["handles/tip/target"]) == steps
    assert len(first["mesh"]) == len(first["strain"]) == steps + 1
    assert first.keys() == second.keys()
    assert all(first[topic] == second[topic] for topic in first)

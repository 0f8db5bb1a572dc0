# SPDX-License-Identifier: Apache-2.0
"""Saved states: later steps have the same bits; invalid states, and those of other scenes, are refused."""

from __future__ import annotations

import io
import json
import pickle
import zipfile

import numpy as np
import pytest

import gdfe_ros
from gdfe_ros.checkpoint import load_state, save_state
from gdfe_ros.constraints import Pose
from gdfe_ros.errors import GdfeError
from gdfe_ros.scene.loader import load_scene
from gdfe_ros.simulation import Command, Simulation


def _simulation(scene: str = "bend5", **overrides: object) -> Simulation:
    return Simulation(load_scene(scene, overrides={"mesh.bar.cells": [10, 2, 2], **overrides}))


def _command(step: int) -> Command:
    return Command(handles={"tip": Pose((0.0, 1e-3 * step, 2e-3 * step))})


def test_a_state_of_another_scene_is_refused() -> None:
    """A state of another scene or with other settings is refused with the differences, and nothing changes."""
    state = save_state(_simulation())
    other = _simulation("twist90")
    before = other.positions.copy()
    with pytest.raises(GdfeError, match=r"does not fit: its scene has another text.*remedy: load it with"):
        load_state(other, state)
    assert np.array_equal(other.positions, before)


def test_a_state_is_an_archive_of_arrays() -> None:
    """A state can be opened with numpy and json: format, version and positions are there, without pickling."""
    simulation = _simulation()
    simulation.step(_command(3))
    with zipfile.ZipFile(io.BytesIO(save_state(simulation))) as archive:
        head, tree = (json.loads(archive.read(name)) for name in ("head.json", "state.json"))
    assert head["version"] == gdfe_ros.__version__
    name = tree["fields"]["state"]["fields"]["positions"]["array"]
    arrays = np.load(io.BytesIO(save_state(simulation)), allow_pickle=False)
    assert np.array_equal(arrays[name], simulation.positions)


@pytest.mark.parametrize("damage", ["noise", "cut", "flipped", "no array", "another class", "hostile"])
def test_damaged_and_hostile_states_are_refused(damage: str) -> None:
    """Noise, a damaged or incomplete state, another class, and a pickle are refused; no code runs, nothing changes."""
    simulation = _simulation()
    before, state = simulation.step(_command(2)).positions, save_state(simulation)
    flipped = bytearray(state)
    flipped[state.index(b"a0.npy") + 100] ^= 1  # in an array: what a zip file says of times is not looked at
    broken = {
        "noise": b"noise",
        "cut": state[:-20],
        "flipped": bytes(flipped),
        "no array": _replaced(state, "a0.npy", None),
        "another class": _replaced(state, "state.json", b'{"class": "Path", "fields": {}}'),
        "hostile": _replaced(state, "a0.npy", pickle.dumps(_Hostile())),
    }
    with pytest.raises(GdfeError, match=r"not a state|damaged"):
        load_state(simulation, broken[damage])
    assert np.array_equal(simulation.positions, before)


def _replaced(state: bytes, name: str, content: bytes | None) -> bytes:
    """Return an archive with other content for an entry, or without the entry."""
    stream = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(state)) as old, zipfile.ZipFile(stream, "w") as new:
        for entry in old.namelist():
            if entry != name:
                new.writestr(entry, old.read(entry))
            elif content is not None:
                new.writestr(entry, content)
    return stream.getvalue()


class _Hostile:
    def __reduce__(self) -> tuple:
        return (print, ("this must not run",))

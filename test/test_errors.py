# SPDX-License-Identifier: Apache-2.0
"""Errors of bad input."""

from __future__ import annotations

import pickle

import pytest

from gdfe_ros.errors import ArmError, DefectsError, MeshError, SceneError


@pytest.mark.parametrize("kind", [MeshError, SceneError, ArmError])
def test_an_error_passes_between_processes(kind: type[DefectsError]) -> None:
    """A pickled error, as from a worker process, keeps its text and its defects."""
    error = pickle.loads(pickle.dumps(kind("body.stl", ["too coarse", "inside out"])))
    assert type(error) is kind
    assert str(error) == "body.stl: 2 defects\n  - too coarse\n  - inside out"
    assert error.defects == ["too coarse", "inside out"]

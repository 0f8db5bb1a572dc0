# SPDX-License-Identifier: Apache-2.0
"""Reference solutions are checked when they are read, and the error metric is the published one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks import references
from benchmarks.cases import CASES, CaseName
from benchmarks.references import load_reference, measure_error


def test_the_metric_is_the_ratio_of_means_and_of_maxima() -> None:
    """The error is the mean distance over the mean displacement, and the largest distance over the largest one."""
    reference = np.array([[3.0, 4.0, 0.0], [0.0, 0.0, 1.0]])
    moved = reference + np.array([[0.0, 0.0, 0.3], [0.1, 0.0, 0.0]])
    error = measure_error(moved, reference)
    assert error.mean == pytest.approx((0.3 + 0.1) / (5.0 + 1.0))
    assert error.maximum == pytest.approx(0.3 / 5.0)


@pytest.mark.parametrize(
    ("displacement", "reference", "text"),
    [
        (np.zeros((2, 3)), np.ones((3, 3)), "shape"),
        (np.array([[0, 0, 0], [0, np.nan, 0]]), np.ones((2, 3)), r"vertices \[1\]"),
        (np.zeros((2, 3)), np.zeros((2, 3)), "does not move"),
    ],
)
def test_meaningless_comparisons_are_refused(displacement, reference, text: str) -> None:
    """Arrays of another shape, values that are not finite and an undeformed reference are refused."""
    with pytest.raises(ValueError, match=text):
        measure_error(displacement, reference)


@pytest.mark.parametrize("name", list(CaseName))
def test_references_are_sampled_on_the_papers_mesh(name: CaseName) -> None:
    """A reference has the scene's vertices in the scene's order, with the handle at its commanded position."""
    reference, grid = load_reference(name), CASES[name].grid()
    np.testing.assert_allclose(reference.vertices, grid.points(), atol=1e-12)
    np.testing.assert_array_equal(reference.displacement[grid.face(right=False)], 0.0)
    face = grid.face(right=True)
    target = CASES[name].handle_displacement(reference.vertices[face])
    columns = slice(1, 3) if CASES[name].slides else slice(0, 3)
    np.testing.assert_allclose(reference.displacement[face][:, columns], target[:, columns], atol=1e-9)


def test_a_bad_reference_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A missing reference is named with the remedy, and displacements that do not fit the vertices are refused."""
    monkeypatch.setattr(references, "FOLDER", tmp_path)
    with pytest.raises(FileNotFoundError, match=r"tensile_fine\.npz.*run from a source checkout"):
        load_reference(CaseName.TENSILE)
    arrays = {"X": np.zeros((3, 3)), "u": np.zeros((2, 3))}
    forces = {"reaction_force": np.zeros(3), "reaction_moment": np.zeros(3)}
    np.savez(tmp_path / "bend5_fine.npz", **arrays, **forces)
    with pytest.raises(ValueError, match="must both be"):
        load_reference(CaseName.BEND5)

# SPDX-License-Identifier: Apache-2.0
"""Reference solutions of the benchmark scenes, and the error of a solution relative to them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.cases import CaseName

Array = npt.NDArray[np.float64]

FOLDER = Path(__file__).resolve().parents[1] / "test" / "data" / "reference"
"""Folder of the reference solutions: mesh-converged, with quadratic elements."""


@dataclass(frozen=True, kw_only=True)
class Reference:
    """A reference solution sampled at the vertices of the paper's mesh.

    Attributes:
        vertices: undeformed positions, shape (n, 3), float64 [m].
        displacement: displacements, shape (n, 3), float64 [m].
        reaction: wrench of the right face on the body, shape (6,): force [N], then moment
            about the face's deformed centre [N m].
    """

    vertices: Array
    displacement: Array
    reaction: Array


@dataclass(frozen=True)
class Error:
    """Error of a solution; both values are fractions (0.01 is one per cent).

    Attributes:
        mean: mean of ``|x - x_ref|`` over all vertices, divided by the mean of ``|u_ref|``.
        maximum: maximum of ``|x - x_ref|``, divided by the maximum of ``|u_ref|``.
    """

    mean: float
    maximum: float


def load_reference(name: CaseName) -> Reference:
    """Read a reference solution.

    Raises:
        FileNotFoundError: if the file is missing; the message names the file and the remedy.
        ValueError: if an array has a wrong shape or is not finite.
    """
    path = FOLDER / f"{name.value}_fine.npz"
    if not path.is_file():
        raise FileNotFoundError(f"no reference solution {path}: run from a source checkout")
    with np.load(path, allow_pickle=False) as data:
        reference = Reference(
            vertices=data["X"],
            displacement=data["u"],
            reaction=np.concatenate([data["reaction_force"], data["reaction_moment"]]),
        )
    shape = reference.vertices.shape
    if len(shape) != 2 or shape[1] != 3 or reference.displacement.shape != shape:
        raise ValueError(f"{path}: X {shape} and u {reference.displacement.shape} must both be (n, 3)")
    if not (np.isfinite(reference.vertices).all() and np.isfinite(reference.displacement).all()):
        raise ValueError(f"{path}: X or u is not finite")
    return reference


def measure_error(displacement: Array, reference: Array) -> Error:
    """Return the error of a displacement field at the same vertices as the reference.

    Args:
        displacement: displacements, shape (n, 3), float64 [m].
        reference: reference displacements, shape (n, 3), float64 [m].

    Raises:
        ValueError: if the shapes differ, a value is not finite or the reference does not move.
    """
    if displacement.shape != reference.shape:
        raise ValueError(f"displacement {displacement.shape} and reference {reference.shape} differ in shape")
    if not np.isfinite(displacement).all():
        bad = np.nonzero(~np.isfinite(displacement).all(axis=1))[0]
        raise ValueError(f"displacement of vertices {bad[:10].tolist()} is not finite")
    distance = np.linalg.norm(displacement - reference, axis=1)
    moved = np.linalg.norm(reference, axis=1)
    if moved.max() == 0.0:
        raise ValueError("the reference does not move: the error has no scale")
    return Error(mean=float(distance.mean() / moved.mean()), maximum=float(distance.max() / moved.max()))

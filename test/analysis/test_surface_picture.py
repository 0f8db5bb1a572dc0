# SPDX-License-Identifier: Apache-2.0
"""Pictures of surfaces show thickness as colours, and defects in red."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest
import trimesh
from PIL import Image

from gdfe_ros.analysis.picture import draw_surface
from gdfe_ros.mesh.meshing.surface_findings import surface_findings

BOX = trimesh.creation.box((0.1, 0.06, 0.04))


def red_pixels(*parts: trimesh.Trimesh, faces: slice = slice(None)) -> int:
    """Return the number of red pixels in the picture of several surfaces together."""
    whole = trimesh.util.concatenate(list(parts))
    found = surface_findings(np.asarray(whole.vertices), np.asarray(whole.faces)[faces], size=0.01)
    buffer = BytesIO()
    draw_surface(buffer, found, title="box")
    image = np.asarray(Image.open(buffer).convert("RGB")).astype(int)
    return int(((image[..., 0] > 120) & (image[..., 1:] < 60).all(axis=2)).sum())


@pytest.mark.parametrize("case", ["cut", "open"])
def test_defects_are_red(case: str) -> None:
    """A sound box has no red pixel; self-intersections and open edges have many."""
    assert red_pixels(BOX) == 0
    if case == "cut":
        assert red_pixels(BOX, BOX.copy().apply_translation((0.05, 0.01, 0.01))) > 1000
    else:
        assert red_pixels(BOX, faces=slice(1, None)) > 200

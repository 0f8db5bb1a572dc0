# SPDX-License-Identifier: Apache-2.0
"""Scenes that make sense one by one of their values and still cannot be solved."""

from __future__ import annotations

import numpy as np

from gdfe_ros.errors import SceneError
from gdfe_ros.scene.scene import Scene

LARGEST_CONTRAST = 1e10
"""Of moduli in one body: beyond it double precision leaves nothing of the softer material. 1e6 is tested."""


def refuse_contrast(scene: Scene) -> None:
    """Refuse a body whose stiffest and softest materials are too far apart.

    Raises:
        SceneError: they are; both are named.
    """
    names = list(scene.materials)
    moduli = {names[i]: scene.materials[names[i]].young0 for i in np.unique(scene.cell_material)}
    if not moduli:
        return
    soft, hard = min(moduli, key=moduli.__getitem__), max(moduli, key=moduli.__getitem__)
    if not moduli[hard] <= LARGEST_CONTRAST * moduli[soft]:
        raise SceneError(
            f"scene {scene.name}",
            [
                f"material {hard!r} is {moduli[hard] / moduli[soft]:.3g} times as stiff at rest as {soft!r}; allowed: "
                f"up to {LARGEST_CONTRAST:g}; remedy: make it a handle, which is rigid, or check the units (Pa)"
            ],
        )

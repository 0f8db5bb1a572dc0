# SPDX-License-Identifier: Apache-2.0
"""A rotation of a scene file: one rotation vector, or several that are applied in turn."""

from __future__ import annotations

from typing import Any

from scipy.spatial.transform import Rotation

from gdfe_ros.scene.quantity import Quantity


class RotationQuantity(Quantity):
    """Annotation of a field that holds a rotation vector [degrees]; several are applied one after another."""

    def check(self, value: Any) -> tuple[float, float, float]:
        """Return the rotation vector (3,) [degrees]; a list of vectors becomes the vector of their composition.

        The axes stay fixed: ``[[0, 90, 0], [0, 0, 120]]`` first turns about y, and then about z.

        Raises:
            PydanticCustomError: a vector has the wrong length, or a component is no number or out of range.
        """
        if not (isinstance(value, list | tuple) and value and all(isinstance(item, list | tuple) for item in value)):
            return super().check(value)
        total = Rotation.identity()
        for vector in value:
            total = Rotation.from_rotvec(super().check(vector), degrees=True) * total
        return tuple(total.as_rotvec(degrees=True).tolist())

    @property
    def _form(self) -> str:
        return f"{super()._form} or a list of such lists"

# SPDX-License-Identifier: Apache-2.0
"""A Jacobian that is reused for several changes of the commands and corrected by the effect of each change."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SURPRISE = 0.3
"""Largest error of the predicted motion, divided by the predicted motion, up to which the Jacobian is reused. Above it,
the exact Jacobian is computed again before the next change.
"""


class KeptJacobian:
    """The Jacobian of values with respect to commands, which is reused for several changes of the commands.

    Broyden's update corrects it after each change. The exact Jacobian is computed again in two cases: the motion of a
    change was predicted badly (`SURPRISE`), or commands or values differ from those at the last update.

    Args:
        exact: function that returns the exact Jacobian (m, n) of the present state.

    Attributes:
        fresh: whether the last call of `at` computed the exact Jacobian.
    """

    def __init__(self, exact: Callable[[], Array]) -> None:
        self._exact = exact
        self._rows: Array | None = None
        self.fresh = False

    def forget(self) -> None:
        """Discard the Jacobian, so that the next call of `at` computes the exact one."""
        self._rows = None

    def at(self, commands: Array, values: Array) -> Array:
        """Return the Jacobian (m, n) for the present commands (n,) and values (t, 3)."""
        known = self._rows is not None
        self.fresh = not (known and all(map(np.array_equal, self._place, (commands, values))))
        if self.fresh:
            self._rows, self._place = self._exact(), (commands, values)
            self._scale = np.maximum(np.linalg.norm(self._rows, axis=0), 1e-300)
        return self._rows

    def learn(self, moved: Array, commands: Array, values: Array) -> None:
        """Correct the Jacobian with the motion ``moved`` (m,) of the last change, and store commands and values."""
        change = commands - self._place[0]
        foretold, scaled = self._rows @ change, self._scale * change
        missed, self._place = moved - foretold, (commands, values)
        if not np.linalg.norm(missed) <= SURPRISE * np.linalg.norm(foretold):
            self.forget()
            return
        self._rows = self._rows + np.outer(missed, self._scale * scaled) / max(float(scaled @ scaled), 1e-300)

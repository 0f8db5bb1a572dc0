# SPDX-License-Identifier: Apache-2.0
"""A Jacobian that is kept between changes of the commands, and corrected by what each of them did."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SURPRISE = 0.3
"""Distance between what a change did and what was foretold, over the latter, from which a new Jacobian is taken: the
way to a goal that moves on is missed by that share of a step."""


class KeptJacobian:
    """The Jacobian of some values with respect to commands, exact where it is taken.

    Broyden's update corrects it by each change that was made. It is taken anew where a change did something else than
    was foretold, and where the commands or values are not those that it was left with.

    Args:
        exact: returns the exact Jacobian (m, n) of the present state.

    Attributes:
        fresh: it was taken where it was last asked for.
    """

    def __init__(self, exact: Callable[[], Array]) -> None:
        self._exact = exact
        self._rows: Array | None = None
        self.fresh = False

    def forget(self) -> None:
        """Have the next one taken anew."""
        self._rows = None

    def at(self, commands: Array, values: Array) -> Array:
        """Return it (m, n) at the present commands (n,) and values (t, 3)."""
        known = self._rows is not None
        self.fresh = not (known and all(map(np.array_equal, self._place, (commands, values))))
        if self.fresh:
            self._rows, self._place = self._exact(), (commands, values)
            self._scale = np.maximum(np.linalg.norm(self._rows, axis=0), 1e-300)
        return self._rows

    def learn(self, moved: Array, commands: Array, values: Array) -> None:
        """Correct it by the change to commands (n,) and values (t, 3) that moved rows by ``moved`` (m,)."""
        change = commands - self._place[0]
        foretold, scaled = self._rows @ change, self._scale * change
        missed, self._place = moved - foretold, (commands, values)
        if not np.linalg.norm(missed) <= SURPRISE * np.linalg.norm(foretold):
            self.forget()
            return
        self._rows = self._rows + np.outer(missed, self._scale * scaled) / max(float(scaled @ scaled), 1e-300)

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
    """The Jacobian of some outputs with respect to commands, exact where it is taken.

    Broyden's update corrects it by each change that was made. It is taken anew where a change did something else than
    was foretold, and where commands or outputs are not those that it was left with.

    Args:
        exact: returns the exact Jacobian (m, n) of the present state.
    """

    def __init__(self, exact: Callable[[], Array]) -> None:
        self._exact = exact
        self._rows: Array | None = None
        self._place: tuple[Array, Array] | None = None
        self.fresh = False

    def forget(self) -> None:
        """Have the next one taken anew."""
        self._rows = None

    def holds(self, commands: Array, outputs: Array) -> bool:
        """Tell whether it is that of a place: commands (n,) and outputs (m,)."""
        known = self._rows is not None and self._place is not None
        return known and all(map(np.array_equal, self._place, (commands, outputs)))

    def at(self, commands: Array, outputs: Array) -> Array:
        """Return it (m, n) at the present place: commands (n,) and outputs (m,)."""
        self.fresh = not self.holds(commands, outputs)
        if self.fresh:
            self._rows, self._place = self._exact(), (commands, outputs)
            self._scale = np.maximum(np.linalg.norm(self._rows, axis=0), 1e-300)
        return self._rows

    def learn(self, commands: Array, outputs: Array) -> None:
        """Correct it by the change that led to commands (n,) and outputs (m,)."""
        change, moved = (new - old for new, old in zip((commands, outputs), self._place, strict=True))
        foretold, scaled = self._rows @ change, self._scale * change
        missed = moved - foretold
        if not np.linalg.norm(missed) <= SURPRISE * np.linalg.norm(foretold):
            self.forget()
            return
        self._rows = self._rows + np.outer(missed, self._scale * scaled) / max(float(scaled @ scaled), 1e-300)
        self._place = commands, outputs

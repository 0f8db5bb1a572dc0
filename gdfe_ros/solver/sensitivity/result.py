# SPDX-License-Identifier: Apache-2.0
"""Result of a sensitivity computation, and its outputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import CommandError


@dataclass(frozen=True, eq=False, kw_only=True)
class Sensitivities:
    """Derivatives of outputs with respect to parameters.

    Attributes:
        outputs: names, in the order of the rows.
        parameters: names, in the order of the columns.
        units: units of the parameters; empty for a dimensionless parameter.
        values: dict from output name to its derivatives (k, p) float64, in the output's unit divided by the parameter's
            unit; outputs are positions [m], forces [N] and moments [N m].
    """

    outputs: tuple[str, ...]
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    values: Mapping[str, NDArray[np.float64]]

    @property
    def matrix(self) -> NDArray[np.float64]:
        """All rows (sum of k, p), output by output.

        Raises:
            CommandError: no parameter was requested, e.g. because the scene has no actuators.
        """
        if not self.parameters:
            raise CommandError("no derivatives: no parameter was named, and the scene may have no actuators")
        rows = [self.values[name] for name in self.outputs]
        return np.concatenate(rows) if rows else np.zeros((0, len(self.parameters)))

    def of(self, output: str, parameter: str) -> NDArray[np.float64]:
        """Return d(output)/d(parameter) (k,).

        Raises:
            CommandError: the output or the parameter was not requested.
        """
        for name, known in ((output, self.outputs), (parameter, self.parameters)):
            if name not in known:
                raise CommandError(f"{name!r} was not asked for; asked for: {', '.join(known) or 'nothing'}")
        return self.values[output][:, self.parameters.index(parameter)]


class Outputs:
    """The outputs of a scene: ``positions``, ``probes.<name>``, ``reactions.<handle or obstacle>``.

    Args:
        probes: dict from name to material point.
        reacting: names of handles and obstacles.
        count: number of vertices of the mesh.
    """

    def __init__(self, probes: Mapping[str, object], reacting: Sequence[str], count: int) -> None:
        self._probes, self._reacting, self._count = probes, tuple(reacting), count

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all outputs."""
        probes = (f"probes.{name}" for name in self._probes)
        return (*probes, *(f"reactions.{name}" for name in self._reacting), "positions")

    def named(self, names: Sequence[str] | None) -> tuple[str, ...]:
        """Return ``names`` after a check; the names of all probes for None.

        Raises:
            CommandError: there is no such output.
        """
        if names is None:
            return tuple(f"probes.{name}" for name in self._probes)
        for name in names:
            if name not in self.names:
                raise CommandError(f"no output {name!r} in this scene; outputs: {', '.join(self.names)}")
        return tuple(names)

    def row(
        self, name: str, motion: NDArray[np.float64], reactions: Mapping[str, NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        """Return the derivative (k,) of an output from the derivatives of positions (n, 3) and reactions (6,)."""
        if name == "positions":
            return motion[: self._count].ravel()
        kind, _, own = name.partition(".")
        return self._probes[own].at(motion)[0] if kind == "probes" else reactions[own]

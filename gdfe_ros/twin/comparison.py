# SPDX-License-Identifier: Apache-2.0
"""Comparison of a simulation's probes with measured positions of the same times."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_KEPT = 600
"""Number of states that are kept, and of measurements that wait for the state of their time."""
LATEST = 5.0
"""A measurement is dropped if the simulation has no state of its time within this time [s]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Sample:
    """The simulation at a time on the robot's clock.

    Attributes:
        stamp: the time [s].
        places: dict from probe to its position (3,) [m].
        derivatives: dict from probe to the derivatives (3, n) [m] with respect to the logarithms of the moduli; None
            if there are none here.
    """

    stamp: float
    places: Mapping[str, NDArray[np.float64]]
    derivatives: Mapping[str, NDArray[np.float64]] | None


@dataclass(frozen=True, eq=False, kw_only=True)
class Deviation:
    """A measured position beside the simulated one.

    Attributes:
        stamp: time of the measurement on the robot's clock [s].
        probe: name of the probe.
        measured, simulated: positions (3,) [m].
        spread: largest distance [m] of the simulated probe from there within the uncertainty of the times.
        derivatives: of the simulated position, as in `Sample`; None if there are none.
    """

    stamp: float
    probe: str
    measured: NDArray[np.float64]
    simulated: NDArray[np.float64]
    spread: float
    derivatives: NDArray[np.float64] | None

    @property
    def distance(self) -> float:
        """Distance of the measured from the simulated position [m]."""
        return float(np.linalg.norm(self.measured - self.simulated))


class ProbeComparison:
    """Keeps states and measurements, and pairs those of the same time; states are interpolated in time.

    A simulation that is at rest makes no steps: its last state then holds for later times, too.

    Args:
        step: time between two states while the simulation moves [s].
        window: uncertainty of the times of commands and measurements [s].
    """

    def __init__(self, step: float, window: float) -> None:
        self._step, self._window = step, window
        self._samples: deque[Sample] = deque(maxlen=_KEPT)
        self._waiting: deque[tuple[float, str, NDArray[np.float64]]] = deque(maxlen=_KEPT)

    def measure(self, stamp: float, probe: str, place: NDArray[np.float64]) -> None:
        """Add a measured position (3,) [m] of a probe at a time [s]."""
        self._waiting.append((stamp, probe, place))

    def add(self, sample: Sample) -> None:
        """Add the state of the simulation at a time that is later than those before."""
        self._samples.append(sample)

    def forget(self) -> None:
        """Forget the states: the simulation was replaced by another one, which has moved since."""
        self._samples.clear()

    def pairs(self, now: float, *, idle: bool) -> list[Deviation]:
        """Return the measurements whose state is known at the time ``now`` [s].

        ``idle``: the simulation is at rest until ``now``.
        """
        found, later = [], []
        for stamp, probe, place in self._waiting:
            if now - stamp > LATEST or not self._samples or stamp < self._samples[0].stamp:
                if now - stamp <= LATEST:
                    later.append((stamp, probe, place))
                continue
            if stamp > self._samples[-1].stamp and not (idle and stamp <= now):
                later.append((stamp, probe, place))
                continue
            found.append(self._paired(stamp, probe, place))
        self._waiting = deque(later, maxlen=_KEPT)
        return found

    def _paired(self, stamp: float, probe: str, place: NDArray[np.float64]) -> Deviation:
        after = next((i for i, each in enumerate(self._samples) if each.stamp >= stamp), len(self._samples) - 1)
        second, first = self._samples[after], self._samples[max(0, after - 1)]
        span = second.stamp - first.stamp
        # Before the first step after an idle time, the body was at rest: the interval of its motion is one step.
        share = min(1.0, max(0.0, 1.0 - (second.stamp - stamp) / min(span, self._step))) if span > 0.0 else 1.0
        there = (1.0 - share) * first.places[probe] + share * second.places[probe]
        return Deviation(
            stamp=stamp,
            probe=probe,
            measured=place,
            simulated=there,
            spread=self._spread(stamp, probe, there),
            derivatives=None if second.derivatives is None else second.derivatives[probe],
        )

    def _spread(self, stamp: float, probe: str, there: NDArray[np.float64]) -> float:
        """Return the largest distance [m] from ``there`` of the probe's places within the window around a time."""
        before = [each for each in self._samples if each.stamp < stamp - self._window][-1:]
        near = [each for each in self._samples if abs(each.stamp - stamp) <= self._window]
        return max((float(np.linalg.norm(each.places[probe] - there)) for each in (*before, *near)), default=0.0)

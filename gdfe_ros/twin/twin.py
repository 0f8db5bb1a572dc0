# SPDX-License-Identifier: Apache-2.0
"""A simulation that follows a robot's commands in real time, is compared with measurements, and fits its moduli."""

from __future__ import annotations

import csv
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import GdfeError
from gdfe_ros.live.interface import View
from gdfe_ros.live.session import LiveSession
from gdfe_ros.node.driving.orders import ActuatorOrder, require_near
from gdfe_ros.node.driving.remodelling import moduli_of
from gdfe_ros.node.refusals import Reason, Refusal, require_finite
from gdfe_ros.simulation import Simulation
from gdfe_ros.twin.estimator import LATEST, Deviation, ModulusEstimator, ProbeComparison, Sample
from gdfe_ros.untrusted.bounded_text import Throttle
from gdfe_ros.untrusted.spelling import did_you_mean

SMALLEST = 0.005
"""Least relative correction of a modulus that is applied; each applied correction rebuilds the simulation."""
LARGEST = 0.5
"""Largest change of the logarithm of a modulus at once; a larger change is applied in parts, each linearised anew."""
_PERIOD = 1.0
"""Shortest time between two changes of moduli [s]."""
_HEAD = (
    "stamp [s]",
    "probe",
    *(f"{kind} {axis} [m]" for kind in ("measured", "simulated") for axis in "xyz"),
    "distance [m]",
    "spread [m]",
)
"""First columns of the CSV file; the spread is `Deviation.spread`."""


class Twin:
    """A simulation that runs beside a robot, with the robot's commands.

    Args:
        simulation: simulation that is ready to step.
        moduli: names of the materials whose Young's moduli are fitted; if empty, the simulation is only compared.
        dt: time of a step [s], in simulation time and in real time.
        noise: standard deviation of the measured positions along an axis [m].
        delay: time by which the stamps of measurements are late [s].
        window: uncertainty of the times of commands and measurements [s]; motions within this time increase the
            standard deviation of a measurement.
        table: path of a CSV file of all measured and simulated positions; None: none is written.
        bag: path of an MCAP file (`TwinBag`); None: none is written.
        on_view: function that is called with the view of each step, in the stepping thread.
        warn: function that receives texts for the user.

    Attributes:
        session: session that steps the simulation, and that a live page can show.
        latest: dict from probe to its last comparison.
        compared: number of measurements that were compared.

    Raises:
        GdfeError: a material has no modulus, the scene has no probes, or the bag exists or cannot be written.
        FileExistsError: the CSV file exists.
    """

    def __init__(
        self,
        simulation: Simulation,
        *,
        moduli: Sequence[str] = (),
        dt: float = 0.02,
        noise: float = 1e-3,
        delay: float = 0.0,
        window: float = 0.3,
        table: Path | None = None,
        bag: Path | None = None,
        on_view: Callable[[View], None] = lambda view: None,
        warn: Callable[[str], None] = lambda text: None,
    ) -> None:
        _require(simulation, moduli)
        self._names, self._on_view, self._warn = tuple(moduli), on_view, warn
        self._throttle = Throttle()
        self._noise, self._delay = noise, delay
        self._estimator, self._comparison = ModulusEstimator(len(self._names)), ProbeComparison(dt, window, noise)
        self._lock, self._changed, self._change = threading.Lock(), 0.0, None
        self._file = None if table is None else table.open("x", newline="", encoding="utf-8")
        self._bag = None
        if bag is not None:
            from gdfe_ros.twin.twin_bag import TwinBag  # needs an extra

            self._bag = TwinBag(bag, simulation.scene)
        self._table = None if self._file is None else csv.writer(self._file)
        if self._table is not None:
            self._table.writerow((*_HEAD, *(f"{name} [Pa]" for name in self._names)))
        self.latest: dict[str, Deviation] = {}
        self.compared, self._idle, self._shown = 0, True, simulation
        self.session = LiveSession(simulation, dt=dt, on_view=self._add_view, warn=warn)

    def start(self) -> None:
        """Start the stepping thread."""
        self.session.start()

    def stop(self) -> None:
        """End the stepping thread, and complete the files."""
        self.session.stop()
        if self._file is not None:
            self._file.close()
        if self._bag is not None:
            self._warn(self._bag.close())

    @property
    def moduli(self) -> dict[str, float]:
        """Present Young's moduli [Pa] of the fitted materials."""
        return {name: self.session.moduli[name] for name in self._names}

    @property
    def deviations(self) -> dict[str, float]:
        """Dict from material to the relative standard deviation of its modulus, with corrections not yet applied."""
        if not self._names:
            return {}
        with self._lock:
            found = np.hypot(self._estimator.deviations, self._estimator.correction)
        return dict(zip(self._names, found.tolist(), strict=True))

    def command(self, values: Mapping[str, float]) -> None:
        """Queue commands of the robot for the next step."""
        self.session.command("commands", ActuatorOrder(dict(values)))

    def measure(self, stamp: float, probe: str, place: NDArray[np.float64]) -> None:
        """Add a measured position (3,) [m] of a probe with its stamp [s].

        Raises:
            Refusal: a number is not finite, the position is far from the undeformed body, or the stamp is more than
                `LATEST` before or after the present time. One such position would spoil the moduli for a minute.
        """
        scene = self.session.scene
        require_finite(position=place.tolist())
        require_near(tuple((place - scene.probes[probe].at(scene.mesh.vertices)[0]).tolist()), scene.mesh.size)
        late = time.time() - stamp
        if abs(late) > LATEST:
            text = (
                f"its stamp is {abs(late):.6g} s {'before' if late > 0.0 else 'after'} this machine's clock; allowed: "
            )
            reason = Reason.STALE if late > 0.0 else Reason.AHEAD
            raise Refusal(reason, f"{text}{LATEST:g} s; remedy: synchronise the clocks, or leave the stamp 0")
        with self._lock:
            self._comparison.measure(stamp - self._delay, probe, place)

    def update(self) -> list[Deviation]:
        """Compare the measurements since the last call with the simulation, and change the moduli when this is due."""
        now = time.time()
        with self._lock:
            found = self._comparison.pairs(now, idle=self._idle and not self.session.stepper.stepping)
            for each in found:
                self.latest[each.probe] = each
                sigma = float(np.hypot(self._noise, each.spread))
                if each.derivatives is not None and self._change is None:
                    self._estimator.add(each.stamp, each.measured - each.simulated, each.derivatives, sigma)
        self.compared += len(found)
        self._write(found)
        self._adapt(now)
        return found

    def _add_view(self, view: View) -> None:
        """Store the state of a step with its derivatives; called in the stepping thread."""
        simulation = self.session.simulation
        places = {name: point.at(view.positions)[0] for name, point in simulation.scene.probes.items()}
        stamp, took = time.time(), self.session.last.result.wall_time
        sample = Sample(stamp=stamp, places=places, derivatives=self._derivatives(simulation), duration=took)
        with self._lock:
            if simulation is not self._shown:
                self._comparison.forget()
            self._comparison.add(sample)
            self._shown = simulation
            self._idle = simulation.settled
        if self._bag is not None:
            self._bag.write_at(sample.stamp, self.session.last)
        self._on_view(view)

    def _derivatives(self, simulation: Simulation) -> dict[str, NDArray[np.float64]] | None:
        """Return the derivatives of the probes with respect to the logarithms of the moduli."""
        probes, moduli = list(simulation.scene.probes), moduli_of(simulation.scene)
        if not self._names or simulation.result is None or not simulation.result.converged:
            return None
        parameters = [f"materials.{name}.young" for name in self._names]
        try:
            found = simulation.sensitivities([f"probes.{name}" for name in probes], parameters)
        except GdfeError as error:  # e.g. at a saddle: this state says nothing about the modulus
            self._warn_seldom("no derivatives", error)
            return None
        scale = np.array([moduli[name] for name in self._names])
        return {name: found.matrix[3 * i : 3 * i + 3] * scale for i, name in enumerate(probes)}

    def _adapt(self, now: float) -> None:
        """Apply the estimated moduli to the simulation, if they differ enough and the last change is complete."""
        if self._change is not None and self._change[0].done():
            (change, step), self._change = self._change, None
            if (error := change.exception()) is None:
                with self._lock:
                    self._estimator.settle(step)
            else:
                self._warn_seldom("the moduli were not changed", error)
        if not self._names or self._change is not None or now - self._changed < _PERIOD:
            return
        with self._lock:
            step = self._estimator.correction
        if (most := float(np.abs(step).max())) < SMALLEST:
            return
        step = min(1.0, LARGEST / most) * step  # in its direction: the moduli of a combination would drift apart
        wanted = {name: young * float(np.exp(d)) for (name, young), d in zip(self.moduli.items(), step, strict=True)}
        self._changed, self._change = now, (self.session.set_moduli(wanted), step)

    def _warn_seldom(self, subject: str, error: BaseException) -> None:
        """Report an error that may come with every step, at most once in five seconds for each subject."""
        if (more := self._throttle.due(subject)) is not None:
            self._warn(f"{subject}: {error}{more}")

    def _write(self, found: Sequence[Deviation]) -> None:
        if self._bag is not None:
            self._bag.compare(found, self.moduli)
        if self._table is None:
            return
        moduli = [f"{young:.6g}" for young in self.moduli.values()]
        for each in found:
            numbers = (*each.measured.tolist(), *each.simulated.tolist(), each.distance, each.spread)
            self._table.writerow((f"{each.stamp:.6f}", each.probe, *(f"{number:.9g}" for number in numbers), *moduli))


def _require(simulation: Simulation, moduli: Sequence[str]) -> None:
    """Raise a `GdfeError` if there is nothing to compare, or a material has no modulus to fit."""
    scene, known = simulation.scene, moduli_of(simulation.scene)
    if not scene.probes:
        raise GdfeError(f"scene {scene.name!r} has no probes, whose positions are compared; add the key `probes`")
    for name in moduli:
        if name not in known:
            text = f"material {name!r} has no Young's modulus to fit; {did_you_mean(name, known)}".rstrip("; ")
            raise GdfeError(f"{text}; materials with one: {', '.join(known) or 'none'}")

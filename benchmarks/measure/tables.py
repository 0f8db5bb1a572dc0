# SPDX-License-Identifier: Apache-2.0
"""The measured tables: script, file, duration and required packages of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import cast

from benchmarks.report import KEPT, Probe


@dataclass(frozen=True, kw_only=True)
class Table:
    """A file of measurements and the script that makes it.

    Attributes:
        name: name of the file in `KEPT`, without its ending.
        module: module that ``python -m`` runs; it accepts ``--out FILE --pictures FOLDER``.
        minutes: approximate duration on two idle cores [min].
        needs: packages without which the table cannot be measured.
        ros: whether nodes are started. They keep the environment's number of threads.
    """

    name: str
    module: str
    minutes: float
    needs: tuple[str, ...] = ()
    ros: bool = False

    @property
    def file(self) -> Path:
        """Path of the report."""
        return KEPT / f"{self.name}.json"

    def missing(self) -> list[str]:
        """Return the required packages that are not installed."""
        return [name for name in self.needs if find_spec(name) is None]

    @property
    def probe(self) -> Callable[[], Probe]:
        """Function that measures the probe with the present code; that of a package is in its ``__main__``."""
        module = import_module(self.module)
        if hasattr(module, "__path__"):
            module = import_module(f"{self.module}.__main__")
        return cast(Callable[[], Probe], module.probe)


TABLES = (
    Table(name="environments", module="benchmarks.environments", minutes=5, needs=("gymnasium",)),
    Table(name="elasticity", module="benchmarks.elasticity", minutes=10, needs=("felupe", "pypardiso")),
    Table(name="streams", module="benchmarks.streams", minutes=2),
    Table(name="robots", module="benchmarks.robots", minutes=1),
    Table(name="motion", module="benchmarks.motion", minutes=1),
    Table(name="public_cases", module="benchmarks.public_cases", minutes=0.5),
    Table(name="afternoon", module="benchmarks.measured_robots.afternoon", minutes=0.2),
    Table(name="measured_arm_steps", module="benchmarks.measured_robots.arm_steps", minutes=0.6),
    Table(name="measured_membrane", module="benchmarks.measured_robots.membrane", minutes=2.5),
    Table(name="measured_module", module="benchmarks.measured_robots.module", minutes=1, needs=("gmsh",)),
    Table(name="measured_rubber", module="benchmarks.measured_robots.rubber", minutes=0.2),
    Table(name="contact", module="benchmarks.contact", minutes=3),
    Table(name="bench_node", module="benchmarks.node.latency", minutes=1, needs=("rclpy",), ros=True),
    Table(name="manners", module="benchmarks.manners", minutes=6, needs=("rclpy",), ros=True),
    Table(name="loop", module="benchmarks.loop", minutes=9),
    Table(name="bench", module="benchmarks", minutes=6),
    Table(name="torture", module="benchmarks.torture.measure", minutes=30),
)
"""All tables, in the order in which they are measured."""
NAMES = tuple(table.name for table in TABLES)

# SPDX-License-Identifier: Apache-2.0
"""The file of a measurement: its provenance, its data, and a probe for a check whether it is outdated."""

from __future__ import annotations

import argparse
import json
import math
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from benchmarks.provenance import ROOT, Provenance, stamp

KEPT = ROOT / "test" / "data"
"""Folder of the files from which the pages are printed."""
IMAGES = ROOT / "docs" / "images"
SHARE = 0.1
"""Largest relative difference between a figure of a new probe and of the table's probe."""

Probe = Mapping[str, float | str]
"""Dict from name to figure of a small, deterministic part of a table; a figure that is a text must not change."""


@dataclass(frozen=True)
class Report:
    """Content of a file of measurements.

    Attributes:
        data: data from which the tables are printed.
        made: provenance: solver, date and machine.
        probe: figures of the same run that a test repeats.
    """

    data: Any
    made: Provenance
    probe: Probe

    def stale(self, now: Probe) -> list[str]:
        """Return a message for each figure that differs from the present probe ``now`` by more than `SHARE`."""
        names = [*self.probe, *(name for name in now if name not in self.probe)]
        return [
            f"{name}: {now.get(name)} now, {self.probe.get(name)} in the table"
            for name in names
            if not _alike(self.probe.get(name), now.get(name))
        ]


def _alike(kept: float | str | None, now: float | str | None) -> bool:
    if isinstance(kept, int | float) and isinstance(now, int | float):
        return math.isclose(kept, now, rel_tol=SHARE)
    return kept is not None and kept == now


def read_report(path: Path) -> Report:
    """Read a file that `write_report` wrote.

    Raises:
        ValueError: the file has another form.
    """
    found = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(found, dict) or set(found) != {"made", "probe", "data"}:
        raise ValueError(f"{path} does not hold made, probe and data; measure it anew: make measure ONLY={path.stem}")
    return Report(found["data"], Provenance(**found["made"]), found["probe"])


def write_report(path: Path, data: Any, probe: Probe) -> None:
    """Write data and probe with the present provenance; the file is replaced completely or not at all.

    Raises:
        ProvenanceError: the commit cannot be found with git.
    """
    keep(path, Report(data, stamp(), probe))


def keep(path: Path, report: Report) -> None:
    """Write a report without changes; the file is replaced completely or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.write_text(json.dumps(asdict(report), indent=1, default=_plain) + "\n", encoding="utf-8")
    beside.replace(path)


def _plain(value: Any) -> Any:
    """Return a numpy number as a Python number.

    Raises:
        TypeError: the value is not a numpy number.
    """
    if hasattr(value, "item"):
        return value.item()
    raise TypeError(f"a report cannot hold {value!r}")


def options(module: str, words: str, name: str) -> argparse.ArgumentParser:
    """Return a parser with the options that all measuring scripts have.

    Args:
        module: name of the module for ``python -m``.
        words: description of the script.
        name: name of the output file, without its ending.
    """
    parser = argparse.ArgumentParser(prog=f"python -m {module}", description=words)
    default = Path("runs", "bench", f"{name}.json")
    parser.add_argument("--out", type=Path, default=default, help=f"file of the report (default: {default})")
    parser.add_argument("--pictures", type=Path, help="folder of the pictures (default: beside the report)")
    return parser


def run_script(
    module: str,
    words: str,
    name: str,
    *,
    measure: Callable[..., Any],
    tables: Callable[[Any], Mapping[str, str] | str],
    probe: Callable[[], Probe],
    draw: Callable[[Path, Any], None] | None = None,
    data: Path | None = None,
) -> None:
    """Measure, write the report, draw its pictures, and print its tables, as the command line says.

    Args:
        module: name of the module for ``python -m``.
        words: description of the script.
        name: name of the output file, without its ending.
        measure: function that returns the data of the report.
        tables: function from data to its table, or to a dict from name to table.
        probe: function that returns the probe.
        draw: function that draws the pictures of data into a folder.
        data: default of the option ``--data``, whose value is then given to ``measure``.
    """
    parser = options(module, words, name)
    if data is not None:
        parser.add_argument("--data", type=Path, default=data, help="recordings; default: those of the page")
    given = parser.parse_args()
    found = measure() if data is None else measure(given.data)
    write_report(given.out, found, probe())
    if draw is not None:
        pictures = given.pictures or given.out.parent
        pictures.mkdir(parents=True, exist_ok=True)
        draw(pictures, found)
    printed = tables(found)
    print(printed if isinstance(printed, str) else "\n\n".join(printed.values()))

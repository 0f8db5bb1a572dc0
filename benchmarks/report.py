# SPDX-License-Identifier: Apache-2.0
"""The file of a measurement: where it is from, the probe that tells whether it is stale, and the data."""

from __future__ import annotations

import argparse
import json
import math
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.provenance import ROOT, Provenance, stamp

KEPT = ROOT / "test" / "data"
"""Folder of the files that the pages are printed from."""
IMAGES = ROOT / "docs" / "images"
SHARE = 0.1
"""By which a figure of a probe may differ from that of its table."""

Probe = Mapping[str, float | str]
"""Figures of a small, deterministic part of a table, by name; a text must not change at all."""


@dataclass(frozen=True)
class Report:
    """What a file of measurements holds.

    Attributes:
        data: what the tables are printed from.
        made: by which solver, when and on what.
        probe: figures of the same run that a test replays; empty for files from before there were probes.
    """

    data: Any
    made: Provenance = field(default_factory=Provenance)
    probe: Probe = field(default_factory=dict)

    def stale(self, now: Probe) -> list[str]:
        """Return what differs from the probe of today by more than `SHARE`, in words; empty if nothing does."""
        if not self.probe:
            return ["measured before probes were kept"]
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
    """Write data and probe with the stamp of now; the file is replaced as a whole, or not at all.

    Raises:
        ProvenanceError: git cannot tell the commit.
    """
    keep(path, Report(data, stamp(), probe))


def keep(path: Path, report: Report) -> None:
    """Write a report as it is; the file is replaced as a whole, or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.write_text(json.dumps(asdict(report), indent=1, default=_plain) + "\n", encoding="utf-8")
    beside.replace(path)


def _plain(value: Any) -> Any:
    """Return a number of numpy as one of Python.

    Raises:
        TypeError: the value is none.
    """
    if hasattr(value, "item"):
        return value.item()
    raise TypeError(f"a report cannot hold {value!r}")


def options(module: str, words: str, name: str) -> argparse.ArgumentParser:
    """Return a parser with the options of every script that measures.

    Args:
        module: as it is called with ``python -m``.
        words: what it does.
        name: of the file, without its ending.
    """
    parser = argparse.ArgumentParser(prog=f"python -m {module}", description=words)
    default = Path("runs", "bench", f"{name}.json")
    parser.add_argument("--out", type=Path, default=default, help=f"file of the report (default: {default})")
    parser.add_argument("--pictures", type=Path, help="folder of the pictures (default: beside the report)")
    return parser

# SPDX-License-Identifier: Apache-2.0
"""A recording node that is killed at random moments: its recovered bags, and their replay."""

from __future__ import annotations

import random
import re
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.node.client import Client, bar
from gdfe_ros.node.interface.topics import MESH
from gdfe_ros.testing.process import NodeProcess, package_environment

_LONGEST = 3.0
"""Latest time of a kill after the first step [s]."""


@dataclass(frozen=True)
class Kills:
    """Result for the bags of killed nodes.

    Attributes:
        killed: number of killed nodes.
        recovered: number of bags that ``gdfe recover`` repaired.
        identical: number of these bags whose ``gdfe replay`` is bit-identical.
        steps: number of replayed steps in all bags.
    """

    killed: int
    recovered: int
    identical: int
    steps: int


def measure(count: int, *, seed: int = 1, home: Path | None = None) -> Kills:
    """Kill ``count`` nodes with SIGKILL while their tips move; ``home`` is the directory of the node's package."""
    chance, recovered, identical, steps = random.Random(seed), 0, 0, 0
    for _ in range(count):
        with TemporaryDirectory(prefix="gdfe_kills_") as folder:
            bag, whole = Path(folder) / "bag", Path(folder) / "whole"
            _record_and_kill(bag, chance.uniform(0.2, _LONGEST), home)
            if _gdfe(home, "recover", str(bag), "--out", str(whole)).returncode:
                continue
            recovered += 1
            said = _gdfe(home, "replay", str(whole)).stdout
            identical += "bit-identical" in said
            steps += int((re.search(r"(\d+) steps", said) or [0, 0])[1])
    return Kills(count, recovered, identical, steps)


def _record_and_kill(bag: Path, seconds: float, home: Path | None) -> None:
    parameters = {**bar(500), "publish_clock": True, "record": True, "bag_path": str(bag)}
    with Client(MESH) as client, NodeProcess(parameters, home=home) as node:
        client.wait_for_node()
        end, number = time.monotonic() + seconds, 0
        while time.monotonic() < end:
            client.command(number)
            client.poll(0.01)
            number += 1
        node.kill()


def _gdfe(home: Path | None, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "gdfe_ros.cli", *arguments]
    # Python's -m searches the working directory first.
    environment = package_environment(home)
    return subprocess.run(command, env=environment, cwd=home, capture_output=True, text=True, check=False)

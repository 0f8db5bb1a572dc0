# SPDX-License-Identifier: Apache-2.0
"""The first minute on a new machine: ``make first-run`` prints times in a scratch clone, and sizes of the extras.

It needs only Python's own modules, git, make and the registry. What is committed is measured.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]
SIZES = """
import json, re
from importlib.metadata import PackageNotFoundError, distribution

def closure(names, seen):
    for name in names:
        name = re.split(r"[^A-Za-z0-9._-]", name.strip())[0].lower().replace("_", "-")
        try:
            found = distribution(name)
        except PackageNotFoundError:
            continue
        if name in seen:
            continue
        seen[name] = sum(each.size or 0 for each in found.files or ())
        closure([each for each in found.requires or () if "extra ==" not in each], seen)
    return seen

own = distribution("gdfe_ros")
base = closure([each for each in own.requires if "extra ==" not in each], {})
sizes = {"base": sum(base.values())}
for extra in own.metadata.get_all("Provides-Extra"):
    wanted = [each for each in own.requires if re.search(rf"extra == .{extra}.$", each)]
    found = closure(wanted, {})
    missing = any(closure([each], {}) == {} for each in wanted)
    sizes[extra] = None if missing else sum(size for name, size in found.items() if name not in base)
print(json.dumps(sizes))
"""
"""Prints the size [byte] of each extra of the environment beyond the base; null where it is not installed."""


def timed(*command: str | Path, cwd: Path) -> tuple[float, float]:
    """Run a command; return wall time and processor time [s], children included."""
    before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run([str(each) for each in command], cwd=cwd, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{command} ended with status {done.returncode}:\n{done.stdout}\n{done.stderr}")
    wall, after = time.perf_counter() - started, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def least(*command: str | Path, cwd: Path, times: int = 5) -> float:
    """Return the least wall time [s] of several runs of a command."""
    return min(timed(*command, cwd=cwd)[0] for _ in range(times))


def row(name: str, wall: float, processor: float | None = None) -> None:
    """Print a row of the table."""
    print(f"| {name} | {wall:.2f} | {'' if processor is None else f'{processor:.1f}'} |", flush=True)


def main() -> int:
    """Print the tables; return 0."""
    with tempfile.TemporaryDirectory(prefix="gdfe_first_run_") as folder:
        root = Path(folder)
        timed("git", "clone", "--quiet", HERE, root / "clone", cwd=root)
        timed("git", "clone", "--quiet", HERE, root / "plain", cwd=root)
        print("| first run | wall [s] | processor [s] |\n|---|---|---|", flush=True)
        row("`make run`, fresh clone", *timed("make", "run", cwd=root / "clone"))
        row("`make run`, again", *timed("make", "run", cwd=root / "clone"))
        timed(sys.executable, "-m", "venv", root / "venv", cwd=root)
        programs = root / "venv" / "bin"
        row("`pip install .`", *timed(programs / "pip", "install", "--quiet", ".", cwd=root / "plain"))
        row("`gdfe solve bend5`, first", *timed(programs / "gdfe", "solve", "bend5", cwd=root))
        row("`gdfe compile`, all scenes after it", *timed(programs / "gdfe", "compile", cwd=root))
        row("`gdfe solve bend5`, again", least(programs / "gdfe", "solve", "bend5", cwd=root))
        row("`gdfe --help`", least(programs / "gdfe", "--help", cwd=root))
        row("`import gdfe_ros`", least(programs / "python", "-c", "import gdfe_ros", cwd=root))
        row("`import gdfe_ros.simulation`", least(programs / "python", "-c", "import gdfe_ros.simulation", cwd=root))
    own = HERE / ".venv" / "bin" / "python"
    done = subprocess.run([str(own), "-c", SIZES], cwd=HERE, capture_output=True, text=True, check=True)
    print("\n| extra | MB beyond the base |\n|---|---|")
    for name, size in json.loads(done.stdout).items():
        print(f"| {name} | {'not installed here' if size is None else f'{size / 1e6:.0f}'} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())

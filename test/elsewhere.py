# SPDX-License-Identifier: Apache-2.0
"""The tests with the rounding of other processors, and with undeformed vertices shifted by 1e-13 of the body's size.

``python test/elsewhere.py [--only NAME] [--twice] [arguments of pytest]`` runs the tests of `COMPUTING`, or those that
are named, once for each entry of `ROUNDINGS`. It prints the failures of each run and a table of all. The exit status is
1 if a test failed.

numba and OpenBLAS can be set to compute like another processor, and NumPy to use no AVX-512: sums are then taken in
another order, or without fused multiplication. Each processor has its own cache of kernels below ``build/elsewhere``,
which is kept: the first run compiles, and later ones do not. The output of pytest for a rounding is in
``build/elsewhere/NAME.log``.

The folders that are not in `COMPUTING` start processes, open pages, install, or check text. Their results do not depend
on rounding, and `make test` runs them.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "build" / "elsewhere"
"""Folder of the kernel caches and of pytest's output."""
COMPUTING = (
    "solver",
    "state",
    "scene",
    "benchmarks",
    "analysis",
    "mesh",
    "materials",
    "actuators",
    "arms",
    "constraints",
    "control",
    "coupling",
    "fitting",
    "test_blas.py",
    "test_checkpoint.py",
    "results",
    "test_simulation.py",
)
"""Folders and files of tests whose results depend on rounding."""
WIDE = ("X86_V4", "AVX512")
"""Prefixes of NumPy's names for processor features of AVX-512."""
CHOOSING = ("NUMBA_CPU_NAME", "OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES", "GDFE_TEST_SHIFT")
"""Environment variables that determine the rounding."""


@dataclass(frozen=True)
class Rounding:
    """Settings that determine how results are rounded.

    Attributes:
        numba: the processor that kernels are compiled for; empty: this one.
        openblas: the processor whose kernels OpenBLAS uses; empty: this one.
        wide: whether NumPy uses AVX-512 if this machine has it.
        shift: seed of the shift of undeformed vertices, as in `test/conftest.py`; empty: none.
        needs: instructions that this machine must have, with Linux's names.
    """

    numba: str = ""
    openblas: str = ""
    wide: bool = True
    shift: str = ""
    needs: tuple[str, ...] = ()

    def environment(self, cache: Path) -> dict[str, str]:
        """Return this process's environment with the settings of the rounding and the kernel cache ``cache``."""
        given = {name: value for name, value in os.environ.items() if name not in CHOOSING}
        known = np.show_config(mode="dicts")["SIMD Extensions"]["found"]
        narrow = "" if self.wide else " ".join(name for name in known if name.startswith(WIDE))
        chosen = dict(zip(CHOOSING, (self.numba, self.openblas, narrow, self.shift), strict=True))
        return {**given, **{name: value for name, value in chosen.items() if value}, "NUMBA_CACHE_DIR": str(cache)}


ROUNDINGS: Mapping[str, Rounding] = {
    "native": Rounding(),
    "haswell": Rounding("x86-64-v3", "Haswell", wide=False, needs=("avx2", "fma")),
    "zen3": Rounding("znver3", "Zen", wide=False, needs=("avx2", "fma", "sha_ni", "vaes")),
    "ivybridge": Rounding("ivybridge", "Sandybridge", wide=False, needs=("avx", "f16c")),
    "skylake-avx512": Rounding("skylake-avx512", "SkylakeX", needs=("avx512f", "avx512dq", "avx512vl")),
    "shifted": Rounding(shift="1"),
}
"""This machine; Intel and AMD with AVX2 and fused multiplication; Intel without both; AVX-512; shifted vertices."""


@dataclass(frozen=True)
class Outcome:
    """The outcome of a run of the tests.

    Attributes:
        name: name of the rounding.
        passed, failed: numbers of tests; an error counts as failed.
        seconds: duration of the run.
        sound: whether the tests ran, and none failed.
        report: pytest's last lines; with failures the report of each.
    """

    name: str
    passed: int
    failed: int
    seconds: float
    sound: bool
    report: str

    def __str__(self) -> str:
        return f"{self.name:16} {self.passed:7} {self.failed:7} {self.seconds:8.0f}"


def lacking(needs: Sequence[str]) -> list[str]:
    """Return the instructions that this machine lacks; an empty list if /proc/cpuinfo does not exist."""
    told = Path("/proc/cpuinfo")
    flags = re.search(r"^flags\s*:(.*)$", told.read_text(encoding="utf-8"), re.MULTILINE) if told.exists() else None
    return [name for name in needs if flags and name not in flags[1].split()]


def run(name: str, arguments: Sequence[str]) -> Outcome:
    """Run the tests with a rounding, write their output to a log file, and return the outcome."""
    command = [sys.executable, "-m", "pytest", "-q", "--no-header", "-p", "no:cacheprovider", *arguments]
    rounding, log = ROUNDINGS[name], KEPT / f"{name}.log"
    KEPT.mkdir(parents=True, exist_ok=True)
    given, begin = rounding.environment(KEPT / (rounding.numba or "native")), time.monotonic()
    with log.open("w", encoding="utf-8") as file:
        done = subprocess.run(command, cwd=ROOT, env=given, check=False, stdout=file, stderr=subprocess.STDOUT)
    text = log.read_text(encoding="utf-8")
    seconds, last = time.monotonic() - begin, text.splitlines()[-1:]
    counts = re.findall(r"(\d+) (passed|failed|error)", last[0] if last else "")
    passed = sum(int(number) for number, word in counts if word == "passed")
    failed = sum(int(number) for number, word in counts if word != "passed")
    report = "\n".join(last) if done.returncode == 0 else text[-20_000:]
    return Outcome(name, passed, failed, seconds, done.returncode == 0, report)


def main() -> int:
    """Run the tests with each rounding; return exit status 1 if one failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", choices=list(ROUNDINGS), help="may be given several times")
    parser.add_argument("--twice", action="store_true", help="each rounding twice")
    options, arguments = parser.parse_known_args()
    named = any(not each.startswith("-") and (ROOT / each.split("::")[0]).exists() for each in arguments)
    chosen = [] if named else [f"test/{each}" for each in COMPUTING]
    outcomes = []
    for name in (1 + options.twice) * (options.only or list(ROUNDINGS)):
        if lacks := lacking(ROUNDINGS[name].needs):
            print(f"{name}: left out, this processor lacks {', '.join(lacks)}", flush=True)
            continue
        outcomes.append(run(name, [*arguments, *chosen]))
        print(f"{name}: {outcomes[-1].report}", flush=True)
    print("\n".join(["", "rounding          passed  failed  seconds", *map(str, outcomes)]))
    return int(not all(outcome.sound for outcome in outcomes))


if __name__ == "__main__":
    sys.exit(main())

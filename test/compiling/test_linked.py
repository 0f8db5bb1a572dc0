# SPDX-License-Identifier: Apache-2.0
"""Kernels that call each other by their addresses."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from gdfe_ros.compiling.compilations import lock_file, unlock_file
from test.written import run_python

SOURCE = """
from gdfe_ros.compiled import internal, kernel

@internal
def long_sum(values):
    total = 0.0
{lines}
    return {result}

@kernel
def twice(values):
    return 2.0 * long_sum(values)
"""
USE = """
import numpy as np
import kernels
print(kernels.twice(np.arange(8.0)), sum(kernels.twice.stats.cache_hits.values()))
"""
LINE = "    if values[{0}] + {1} >= {0}:\n        total += values[{2}] / {3}"
LINES = "\n".join(LINE.format(i % 8, i, 3 * i % 8, i + 1) for i in range(80))


def _run(folder: Path) -> tuple[str, int, int]:
    """Call the kernel in a new process; return its value, hits of the cache, and the size of the caller's file."""
    done = run_python(USE, NUMBA_CACHE_DIR=folder / "cache", PYTHONPATH=folder)
    value, hits = done.stdout.split()
    sizes = {each.name.partition("-")[0]: each.stat().st_size for each in (folder / "cache").rglob("*.nbc")}
    return value, int(hits), sizes["kernels.twice"]


def test_a_caller_follows_a_changed_kernel(tmp_path: Path) -> None:
    """A caller from the cache calls the new version of an edited kernel, and is compiled anew for another type."""
    source = tmp_path / "kernels.py"
    source.write_text(SOURCE.format(lines=LINES, result="total"))
    first, hits, size = _run(tmp_path)
    assert hits == 0
    assert float(first) > 0.0
    assert size < 30_000, "the caller contains the called kernel"
    assert _run(tmp_path)[:2] == (first, 1)
    source.write_text(SOURCE.format(lines=LINES, result="2.0 * total"))
    assert float(_run(tmp_path)[0]) == 2.0 * float(first)
    source.write_text(SOURCE.format(lines=LINES, result="3 * int(total)"))
    assert float(_run(tmp_path)[0]) == 6.0 * int(float(first) / 2.0)


PART = """
from gdfe_ros.compiled import inlined
from {module} import long_sum

@inlined
def add_up(values):
    return long_sum(values)
"""
CALLER = """
from gdfe_ros.compiled import kernel
from part import add_up

@kernel
def triple(values):
    return 3.0 * add_up(values)
"""


def test_a_caller_of_a_kernel_that_has_moved_is_compiled_anew(tmp_path: Path) -> None:
    """After an upgrade that moved a kernel, an unchanged caller, which has it from an inlined function, still works."""
    (tmp_path / "kernels.py").write_text(SOURCE.format(lines=LINES, result="total"))
    (tmp_path / "caller.py").write_text(CALLER)

    def run(module: str) -> str:
        (tmp_path / "part.py").write_text(PART.format(module=module))
        use = "import numpy as np, caller; print(caller.triple(np.arange(8.0)))"
        return run_python(use, NUMBA_CACHE_DIR=tmp_path / "cache", PYTHONPATH=tmp_path).stdout

    first = run("kernels")
    (tmp_path / "kernels.py").rename(tmp_path / "moved.py")
    assert float(first) > 0.0
    assert run("moved") == first


TYPED = """
from gdfe_ros.compiled import kernel

@kernel
def total(row):
    return row.x + 1.0
"""
TYPE = """
from typing import NamedTuple

class Row(NamedTuple):
    x: float
"""


def test_a_cache_of_types_that_are_gone_counts_as_absent(tmp_path: Path) -> None:
    """After an upgrade that moved a type, an unchanged kernel is compiled anew, and then loaded again."""
    (tmp_path / "kernels.py").write_text(TYPED)

    def run(module: str) -> list[str]:
        hits = "*kernels.total.stats.cache_hits.values()"
        use = f"import kernels, {module}; print(kernels.total({module}.Row(2.0)), {hits})"
        return run_python(use, NUMBA_CACHE_DIR=tmp_path / "cache", PYTHONPATH=tmp_path).stdout.split()

    (tmp_path / "old.py").write_text(TYPE)
    assert [run("old"), run("old")] == [["3.0"], ["3.0", "1"]]
    (tmp_path / "old.py").rename(tmp_path / "new.py")
    assert [run("new"), run("new")] == [["3.0"], ["3.0", "1"]]


FOREIGN = """
import numpy as np
from numba import njit
import kernels

@njit(cache=True)
def half(values):
    return 0.5 * kernels.long_sum(values)
"""


def test_a_function_of_a_user_calls_kernels_in_each_process(tmp_path: Path) -> None:
    """Numba's own cache, which knows no symbols of kernels, stores no function that calls one."""
    (tmp_path / "kernels.py").write_text(SOURCE.format(lines=LINES, result="total"))
    (tmp_path / "foreign.py").write_text(FOREIGN)
    use = "import numpy as np, foreign; print(foreign.half(np.arange(8.0)))"
    for _ in range(2):
        done = run_python(use, NUMBA_CACHE_DIR=tmp_path / "cache", PYTHONPATH=tmp_path)
        assert "Cannot cache compiled function" in done.stderr
        assert float(done.stdout) > 0.0


FLAT = """
from gdfe_ros.compiled import kernel
{called}
@kernel
def total(values):
    return long_sum({given})
"""


def test_a_caller_of_a_kernel_with_other_arguments_is_compiled_anew(tmp_path: Path) -> None:
    """After a change of the arguments that a kernel takes, an unchanged caller of its callers still works."""
    (tmp_path / "caller.py").write_text(CALLER)
    (tmp_path / "part.py").write_text(PART.format(module="kernels").replace("long_sum", "total"))

    def run(lines: str, given: str) -> str:
        source = SOURCE.format(lines=lines, result="total").partition("@kernel")[0]
        (tmp_path / "kernels.py").write_text(FLAT.format(called=source, given=given))
        use = "import numpy as np, caller; print(caller.triple(np.arange(8.0)))"
        return run_python(use, NUMBA_CACHE_DIR=tmp_path / "cache", PYTHONPATH=tmp_path).stdout

    first = run(LINES, "values")
    assert float(first) > 0.0
    assert run(LINES.replace("values[", "values[0, "), "values.reshape((1, -1))") == first


MEANWHILE = """
import sys, time
from pathlib import Path
import numpy as np
import kernels
Path(sys.argv[1]).touch()
while not Path("go").exists():
    time.sleep(0.001)
kernels.twice(np.arange(8.0))
print(sum(kernels.twice.stats.cache_misses.values()), sum(kernels.long_sum.stats.cache_misses.values()))
"""


def test_processes_that_need_a_kernel_at_once_compile_it_once(tmp_path: Path) -> None:
    """Of three processes that call a new kernel at the same time one compiles it, and what it calls; none is left."""
    (tmp_path / "kernels.py").write_text(SOURCE.format(lines=LINES, result="total"))
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
    names = "abc"
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", MEANWHILE, name], cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True
        )
        for name in names
    ]
    while not all((tmp_path / name).exists() for name in names):
        assert all(each.poll() is None for each in processes)
        time.sleep(0.01)
    (tmp_path / "go").touch()
    counts = [[int(word) for word in each.communicate()[0].split()] for each in processes]
    assert np.sum(counts, axis=0).tolist() == [1, 1]
    assert not list((tmp_path / "cache").rglob("*.lock"))


def test_a_lock_ends_with_its_process(tmp_path: Path) -> None:
    """The lock of a process that was killed is free."""
    path = str(tmp_path / "kernel.lock")
    take = f"from gdfe_ros.compiling.compilations import lock_file; lock_file({path!r})"
    hold = f"{take}; print('held', flush=True); input()"
    with subprocess.Popen(
        [sys.executable, "-c", hold], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "held\n"
        process.kill()
        process.wait()
        unlock_file(lock_file(path), path)
    assert not Path(path).exists()


def test_a_full_disk_of_the_cache_costs_only_the_cache(tmp_path: Path) -> None:
    """If kernels cannot be stored because the disk is full, they run all the same, and one warning names the folder."""
    (tmp_path / "kernels.py").write_text(SOURCE.format(lines=LINES, result="total"))
    full = "import errno, gdfe_ros.compiling.linked as linked\n" + "\n".join(
        (
            "def save(*_):",
            "    raise OSError(errno.ENOSPC, 'No space left on device')",
            "linked.LinkedCacheFile.save = save",
        )
    )
    done = run_python(full + USE, NUMBA_CACHE_DIR=tmp_path / "cache", PYTHONPATH=tmp_path)
    assert done.stdout.split()[1] == "0"
    assert done.stderr.count("No space left on device") == 1
    assert str(tmp_path / "cache") in done.stderr

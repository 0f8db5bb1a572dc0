# SPDX-License-Identifier: Apache-2.0
"""Entry points of the console scripts. They import little, so that an early interrupt leaves no traceback."""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import FrameType, ModuleType

from gdfe_ros.errors import DependencyError

INTERRUPTED = 130
"""Exit status of an interrupted command, as in shells; the exit status of an interrupted node is 0."""
BAD_MACHINE = 2
"""Exit status if a required dependency is too old."""


def gdfe() -> int:
    """Run the command ``gdfe``."""
    with quiet_imports("gdfe", INTERRUPTED):
        main = imported("gdfe_ros.cli").main
    return main()


def sim_node() -> int:
    """Run the simulation node; once it spins, its own handlers process the signals."""
    with quiet_imports("sim_node", 0):
        return imported("gdfe_ros.node.sim_node").main()


def carrying_arm() -> int:
    """Run the example arm."""
    with quiet_imports("carrying_arm", 0):
        return imported("gdfe_ros.examples.carrying_arm").main()


def tip_tracking() -> int:
    """Run the example controller."""
    with quiet_imports("tip_tracking", 0):
        return imported("gdfe_ros.examples.tip_tracking").main()


def imported(name: str) -> ModuleType:
    """Import a module, without garbage collection (`without_collection`), and return it."""
    if name in sys.modules:
        return sys.modules[name]
    with without_collection():
        return import_module(name)


@contextmanager
def without_collection() -> Iterator[None]:
    """Disable Python's cyclic garbage collection inside the ``with`` block, e.g. during imports.

    Nearly all objects that are created there exist until the process ends. They are excluded from later collections,
    because a collection stops every thread.
    """
    before = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if before:
            gc.enable()


def collect() -> None:
    """Collect all cyclic garbage before the interpreter shuts down; otherwise language bindings print errors for it."""
    gc.unfreeze()
    gc.collect()


@contextmanager
def quiet_imports(name: str, status: int) -> Iterator[None]:
    """End the process at once if SIGINT arrives inside the ``with`` block, in which no resources are open.

    KeyboardInterrupt is not sufficient, because libraries that look for optional packages catch it and continue. A
    dependency that is too old also ends the process, with a message of one line.
    """

    def end(number: int, frame: FrameType | None) -> None:
        os.write(sys.stderr.fileno(), f"{name}: interrupted while starting\n".encode())
        os._exit(status)

    before = signal.signal(signal.SIGINT, end)
    try:
        yield
    except DependencyError as error:
        print(f"{name}: {error}", file=sys.stderr)
        raise SystemExit(BAD_MACHINE) from error
    finally:
        signal.signal(signal.SIGINT, before)

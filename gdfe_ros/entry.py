# SPDX-License-Identifier: Apache-2.0
"""What the console scripts call. Light, so that an interrupt while the rest is imported leaves no traceback."""

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
"""Exit status of an interrupted command, as shells have it; that of a node is 0."""
BAD_MACHINE = 2
"""Exit status where something is missing that everything needs."""


def gdfe() -> int:
    """Run the command ``gdfe``."""
    with quiet_imports("gdfe", INTERRUPTED):
        main = imported("gdfe_ros.cli").main
    return main()


def sim_node() -> int:
    """Run the simulation node; once it spins, its own handlers take the signals."""
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
    """Import a module `without_collection`, where it is not there yet."""
    if name in sys.modules:
        return sys.modules[name]
    with without_collection():
        return import_module(name)


@contextmanager
def without_collection() -> Iterator[None]:
    """Import and build without Python's search for unused cycles, which would find none and take its time.

    Nearly all that is made meanwhile stays to the end. Later searches, which hold up every thread, leave it out.
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
    """Free all that is held by cycles alone, while the interpreter is whole: at its end bindings complain of them."""
    gc.unfreeze()
    gc.collect()


@contextmanager
def quiet_imports(name: str, status: int) -> Iterator[None]:
    """End the process at once where SIGINT arrives inside: nothing is open yet that would have to be finished.

    KeyboardInterrupt will not do: libraries catch it while they probe what is installed, and go on. A dependency that
    is too old ends it, too, in one line.
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

# SPDX-License-Identifier: Apache-2.0
"""Entry points of the console scripts. They import little, so that an early interrupt leaves no traceback."""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from types import FrameType, ModuleType
from typing import Any

from gdfe_ros.errors import DependencyError
from gdfe_ros.installation import remedy

ENDINGS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that ask a process to end: from a terminal, from a manager of processes, and if the terminal is closed."""
NODE_ENDINGS = (signal.SIGINT,)
"""Signals that end a node even if they were ignored at its start; rclpy does the same. A shell script starts background
processes with SIGINT ignored, and may later send SIGINT to end them.
"""
INTERRUPTED = 130
"""Exit status of an interrupted command, as in shells; the exit status of an interrupted node is 0."""
BAD_MACHINE = 2
"""Exit status if a required dependency is too old or missing."""


def gdfe() -> int:
    """Run the command ``gdfe``."""
    with quiet_imports("gdfe", INTERRUPTED):
        main = import_uncollected("gdfe_ros.cli").main
    return main()


def sim_node() -> int:
    """Run the simulation node; once it spins, its own handlers process the signals."""
    with quiet_imports("sim_node", 0, always=NODE_ENDINGS):
        return import_uncollected("gdfe_ros.node.sim_node").main()


def carrying_arm() -> int:
    """Run the example arm."""
    with quiet_imports("carrying_arm", 0, always=NODE_ENDINGS):
        return import_uncollected("gdfe_ros.examples.carrying_arm").main()


def tip_tracking() -> int:
    """Run the example controller."""
    with quiet_imports("tip_tracking", 0, always=NODE_ENDINGS):
        return import_uncollected("gdfe_ros.examples.tip_tracking").main()


def import_uncollected(name: str) -> ModuleType:
    """Import a module, without garbage collection (`without_collection`), and return it."""
    if name in sys.modules:
        return sys.modules[name]
    with without_collection():
        return import_module(name)


@contextmanager
def without_collection(*, keep: bool = True) -> Iterator[None]:
    """Disable Python's cyclic garbage collection inside the ``with`` block, e.g. during imports.

    Nearly all objects that are created there exist until the process ends. With ``keep``, all objects that exist at the
    end of the block are excluded from later collections, because a collection stops every thread.
    """
    before = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if keep:
            gc.freeze()
        if before:
            gc.enable()


def collect() -> None:
    """Collect all cyclic garbage before the interpreter shuts down; otherwise language bindings print errors for it."""
    gc.unfreeze()
    gc.collect()


@contextmanager
def quiet_imports(name: str, status: int, *, always: Sequence[signal.Signals] = ()) -> Iterator[None]:
    """End the process at once if SIGINT, SIGTERM or SIGHUP arrives inside the ``with`` block.

    The process ends without cleanup; therefore the block must not have open resources.

    A signal that is ignored at the start, as SIGHUP is by ``nohup``, stays ignored, except those in ``always``.
    KeyboardInterrupt is not sufficient: libraries that look for optional packages catch it and continue. A dependency
    that is too old, and an extra that is not installed, also end the process, with a message of one line.
    """

    def end(number: int, frame: FrameType | None) -> None:
        os.write(sys.stderr.fileno(), f"{name}: interrupted while starting\n".encode())
        os._exit(status and 128 + number)

    before = catch_endings(end, always=always)
    try:
        yield
    except DependencyError as error:
        print(f"{name}: {error}", file=sys.stderr)
        raise SystemExit(BAD_MACHINE) from error
    except ModuleNotFoundError as error:
        if (text := remedy(error, command=name.removeprefix("gdfe "))) is None:
            raise
        print(f"{name}: {text}", file=sys.stderr)
        raise SystemExit(BAD_MACHINE) from error
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def catch_endings(
    handler: Callable[[int, FrameType | None], object], *, always: Sequence[signal.Signals] = ()
) -> dict[int, Any]:
    """Let a function handle the signals that end a process, except those that are ignored and not in ``always``.

    Returns:
        Dict from signal to its former handler.
    """
    caught = [each for each in ENDINGS if each in always or signal.getsignal(each) is not signal.SIG_IGN]
    return {number: signal.signal(number, handler) for number in caught}

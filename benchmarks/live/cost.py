# SPDX-License-Identifier: Apache-2.0
"""Cost of the live page for the solver, and resources that viewers leave behind: in one process, without a browser."""

from __future__ import annotations

import gc
import os
import statistics
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from ctypes import CDLL
from multiprocessing import get_context
from pathlib import Path

from benchmarks.live.viewer import Viewer
from gdfe_ros.live.page import Page
from gdfe_ros.live.session import LiveSession
from gdfe_ros.node.pace import ClockMode
from gdfe_ros.scene import Scene
from gdfe_ros.simulation import Simulation

_STEPS = 60
"""Number of steps of the program in each run."""


@contextmanager
def page_of(scene: Scene) -> Iterator[tuple[Page, LiveSession]]:
    """Yield a live page and its session for a scene that is stepped as fast as possible."""
    page = Page(host="127.0.0.1", port=8700, frames=30.0)
    simulation = Simulation(scene)
    simulation.warm_up()
    session = LiveSession(simulation, clock=ClockMode.FAST, told=page.take)
    page.show(session)
    session.start()
    try:
        yield page, session
    finally:
        session.stop()
        page.close()


def shares(scene: Scene, *, rounds: int) -> dict[str, float]:
    """Play the same steps without a viewer, with one viewer, and with one viewer that receives nothing, in turn.

    Returns:
        Dict from case to the median of the wall time, divided by the wall time without viewers. ``processor`` is the
        processor time of the page's threads with one viewer, divided by the processor time of the stepper: the least of
        all rounds.
    """
    with page_of(scene) as (page, session):
        _play(session)
        ratios: dict[str, list[float]] = {"one viewer": [], "a viewer that hangs": []}
        processor = []
        for _ in range(rounds):
            alone = _play(session)[0]
            with _watched(page.address(), hangs=False):
                wall, own, others = _play(session)
            ratios["one viewer"].append(wall / alone)
            processor.append(others / own)
            with _watched(page.address(), hangs=True):
                ratios["a viewer that hangs"].append(_play(session)[0] / alone)
        return {**{case: statistics.median(each) for case, each in ratios.items()}, "processor": min(processor)}


def leftovers(scene: Scene, *, reloads: int, at_once: int, times: int = 3) -> dict[str, list[float]]:
    """Connect and disconnect viewers of another process while the program plays, ``times`` times.

    Returns:
        Number of threads, memory [MiB] and number of Python objects of this process, before and after each time.
    """
    left: dict[str, list[float]] = {"threads": [], "memory": [], "objects": []}
    context = get_context("spawn")
    with page_of(scene) as (page, session):
        for count in (10, *[reloads] * times):
            session.play()
            visitors = context.Process(target=_visit, args=(page.address(), count, at_once))
            visitors.start()
            visitors.join()
            while page.viewers:
                time.sleep(0.05)
            gc.collect()
            CDLL(None).malloc_trim(0)  # memory that only the allocator keeps does not count
            left["threads"].append(threading.active_count())
            left["memory"].append(_memory())
            left["objects"].append(len(gc.get_objects()))
    return left


def _visit(address: str, reloads: int, at_once: int) -> None:
    viewers = [Viewer(address) for _ in range(at_once)]
    for viewer in viewers:
        viewer.wait(lambda viewer=viewer: viewer.frames, "a frame")
        viewer.__exit__(None, None, None)
    for _ in range(reloads):
        with Viewer(address) as viewer:
            viewer.wait(lambda viewer=viewer: "least det F" in viewer.text(), "the page")


def _play(session: LiveSession) -> tuple[float, float, float]:
    """Play the program's first steps; return wall time, and processor times of the stepper and of other threads [s]."""
    session.pause(True)
    session.reset()
    session.stepper.post(lambda: None).result()
    first = session.stepper.count
    own, everything = session.stepper.post(time.thread_time).result(), time.process_time()
    started = time.perf_counter()
    session.play()
    while session.stepper.count < first + _STEPS:
        time.sleep(0.002)
    wall = time.perf_counter() - started
    session.pause(True)
    own = session.stepper.post(time.thread_time).result() - own
    return wall, own, time.process_time() - everything - own


@contextmanager
def _watched(address: str, *, hangs: bool) -> Iterator[None]:
    """Run a viewer in another process inside the ``with`` block; if it ``hangs``, it receives no messages."""
    context = get_context("spawn")
    ready, over = context.Event(), context.Event()
    process = context.Process(target=_look, args=(address, hangs, ready, over))
    process.start()
    if not ready.wait(120.0):
        raise TimeoutError("the viewer does not see the page")
    try:
        yield
    finally:
        over.set()
        process.join()


def _look(address: str, hangs: bool, ready: threading.Event, over: threading.Event) -> None:
    with Viewer(address) as viewer:
        viewer.wait(lambda: viewer.nodes, "the page")
        ready.set()
        while not over.is_set():
            if hangs:
                over.wait(0.1)
            else:
                viewer.receive(0.1)


def _memory() -> float:
    """Return the resident memory of this process [MiB]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1])
    return pages * os.sysconf("SC_PAGESIZE") / 2**20

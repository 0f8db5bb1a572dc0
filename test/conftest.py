# SPDX-License-Identifier: Apache-2.0
"""Isolation of tests: a ROS domain per worker, one thread, strict message fields, logs in their own folder.

The environment is set before anything imports rclpy, a message package or numba; subprocesses inherit it.
"""

from __future__ import annotations

import gc
import os
import re
import signal
import socket
import sys
import tempfile
import threading
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from threadpoolctl import threadpool_limits

if TYPE_CHECKING:
    from distributed import Client

# How long an example takes says nothing on a machine that others use, too.
settings.register_profile("busy", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("busy")
_LOCKS: list[socket.socket] = []
TESTS = Path(__file__).parent
WAITING = (
    "live",
    "packaging",
    "examples",
    "node",
    "testing",
    "launch",
    "analysis",
    "recording",
    "benchmarks",
    "commands",
)
"""Folders whose tests wait for other processes, those with the longest waits first."""
LONG = (
    "test_contact_scenes",
    "test_same_bits",
    "test_sample",
    "test_same_equilibrium",
    "test_rigid_pairs",
    "test_robots",
    "test_blows",
    "test_skin",
    "test_certified",
    "test_folds",
    "test_threads",
)
"""Files with the longest computing times. They start first, so that all workers finish at about the same time."""
UNCOMPILED = ("test_mesh_files", "test_tetrahedralise", "test_stress")
"""Long files that need no kernels of the solver. They start beside the first of `LONG`, whose kernels are compiled."""
APART = ("materials", "mesh", "packaging")
"""Folders whose tests neither solve nor start nodes."""
KERNELS = (
    ("bend5", {}),
    ("bend5", {"solver.policy": "relative"}),
    ("tendon_finger", {}),
    ("pneunet", {}),
    ("drop", {}),
    ("whip", {}),
)
"""Scenes and overrides that together use nearly every single-threaded kernel."""
_READY: list[bool] = []
SHIFT = "GDFE_TEST_SHIFT"
"""Environment variable with the seed of a shift of undeformed vertices (`test/elsewhere.py`); unset or empty: none."""
SHIFTED_BY = 1e-13
"""Largest shift of a coordinate divided by the body's size."""


def _domain() -> str:
    """Return a ROS domain from 1 to 100 (above 101, ports collide with those that Linux gives out).

    It differs between the workers of one run, and between runs at the same time on this machine.
    """
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID", str(os.getpid()))
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
    first = zlib.crc32(run.encode()) + worker
    domains = [1 + (first + k) % 100 for k in range(100)]
    return str(next(filter(_lock, domains), domains[0]))


def _lock(domain: int) -> bool:
    """Bind an abstract socket (Linux) that reserves a domain until this process ends; return whether it was free."""
    lock = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        lock.bind(f"\0gdfe_ros_test_domain_{domain}")
    except OSError:
        lock.close()
        return False
    _LOCKS.append(lock)
    return True


# Hundreds of processes are started, each of which would compile the package's modules anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
os.environ.update(
    ROS_DOMAIN_ID=_domain(),
    ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST",
    # Wrong scalar types raise, instead of being serialised as garbage.
    ROS_PYTHON_CHECK_FIELDS="1",
    ROS_LOG_DIR=os.path.join(tempfile.gettempdir(), "gdfe_ros_test_logs"),
    NUMBA_NUM_THREADS="1",
    OMP_NUM_THREADS="1",
    # Threads of one solve sleep until all are done: beside other workers, spinning takes four times the time.
    OMP_WAIT_POLICY="PASSIVE",
    OPENBLAS_NUM_THREADS="1",
    MPLBACKEND="Agg",
)

threadpool_limits(1)  # NumPy is loaded already; the bits of replays depend on the number of threads of BLAS


# A shell that starts the tests in the background has them ignore SIGINT, and every process that they start.
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_configure() -> None:
    """Shift the undeformed vertices of every body, if the environment variable `SHIFT` is set."""
    if os.environ.get(SHIFT):
        _shift_bodies(int(os.environ[SHIFT]))


def _shift_bodies(seed: int) -> None:
    """Shift the undeformed vertices of each new body by up to `SHIFTED_BY`; equal bodies are shifted equally."""
    from gdfe_ros.solver.body import Body

    build = Body.build.__func__

    def shifted(cls: type[Body], rest: np.ndarray, cells: np.ndarray, *args: Any, **options: Any) -> Body:
        count, moved = int(np.max(cells)) + 1, np.array(rest)
        size = float(np.linalg.norm(np.ptp(moved[:count], axis=0)))
        random = np.random.default_rng([seed, zlib.crc32(moved.tobytes())])
        moved[:count] += SHIFTED_BY * size * random.uniform(-1.0, 1.0, (count, 3))
        return build(cls, moved, cells, *args, **options)

    Body.build = classmethod(shifted)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mix files whose tests wait with files that compute, the long ones first, so that cores are always in use.

    If vertices are shifted, tests marked ``exact`` are skipped.
    """
    if os.environ.get(SHIFT):
        reason = f"{SHIFT} is set"
        for item in items:
            if item.get_closest_marker("exact"):
                item.add_marker(pytest.mark.skip(reason=reason))
    files = list(dict.fromkeys(item.path for item in items))
    waiting = sorted((path for path in files if _room(path) in WAITING), key=lambda path: WAITING.index(_room(path)))
    computing = sorted((path for path in files if _room(path) not in WAITING), key=_rank)
    places = {path: (k + 0.5) / len(each) for each in (waiting, computing) for k, path in enumerate(each)}
    items.sort(key=lambda item: (places[item.path], str(item.path)))


def _rank(path: Path) -> int:
    """Return the place of a file among those that compute: one of `LONG`, `UNCOMPILED`, more of `LONG`, others."""
    order = (LONG[0], *UNCOMPILED, *LONG[1:])
    return order.index(path.stem) if path.stem in order else len(order)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Compile kernels and prepare forking before a worker's first test that solves or starts nodes.

    This happens before the fixtures of that test's module.
    """
    if not _READY and _room(item.path) not in APART:
        from gdfe_ros.testing import forking

        _compile()
        forking.prepare()
        _READY.append(True)


def _compile() -> None:
    """Compile or load what most tests need. Each kernel is compiled by one worker; each begins with another scene."""
    from gdfe_ros import Simulation, load_scene

    first = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % len(KERNELS)
    for name, overrides in KERNELS[first:] + KERNELS[:first]:
        Simulation(load_scene(name, overrides=overrides)).warm_up()


def _room(path: Path) -> str:
    """Return the name of a test's folder below test/."""
    return path.relative_to(TESTS).parts[0]


SLAB = """
name: slab
mesh: {bar: {size: [0.1, 0.1, 0.04], cells: [2, 2, 1]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.4, density: 1000}}
regions: [{material: soft}]
handles: {}
loads: {weight: {gravity: [0, 0, -9.81]}}
obstacles: {table: {plane: [0, 0, 1], at: [0, 0, -0.0205]}}
bodies: {part: {box: {size: [0.04, 0.03, 0.02]}, density: 1500, at: [0.05, 0, 0.031]}}
dynamics: {scheme: bdf2, step: 0.005, damping: {viscosity: 500}}
"""
"""Scene text of a soft slab, a table below it, and a rigid box above it."""


@pytest.fixture
def slab(tmp_path: Path) -> Path:
    """Return the path of a scene in which a slab falls on a table, and a box on the slab."""
    path = tmp_path / "slab.yaml"
    path.write_text(SLAB)
    return path


class RosSession:
    """A ROS context with its own executor; nodes made here are destroyed with it.

    Attributes:
        context: the rclpy context.
        executor: single-threaded; `wait` spins it.
    """

    def __init__(self) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self._nodes: list[Any] = []

    def node(self, kind: str | Callable[..., Any], **options: Any) -> Any:
        """Make a node, a plain one by name or an instance of a class, and add it to the executor."""
        import rclpy

        make = (lambda **more: rclpy.create_node(kind, **more)) if isinstance(kind, str) else kind
        node = make(context=self.context, **options)
        self.executor.add_node(node)
        self._nodes.append(node)
        return node

    def wait(self, done: Callable[[], Any], *, seconds: float = 300.0, alive: Callable[[], bool] = lambda: True) -> Any:
        """Spin until ``done`` returns a true value, and return it; fail late, or once ``alive`` returns False."""
        end = time.monotonic() + seconds
        while not (value := done()):
            assert alive(), "the process has ended"
            assert time.monotonic() < end, f"waited for {seconds} s in vain"
            self.executor.spin_once(timeout_sec=0.05)
        return value

    def close(self) -> None:
        """Destroy the nodes and shut the context down."""
        import rclpy

        self._destroy_nodes()
        self.executor.shutdown()
        rclpy.shutdown(context=self.context)
        # What a test still refers to may keep a node's name in the graph of this worker until it is collected.
        gc.collect()

    def _destroy_nodes(self) -> None:
        while self._nodes:
            node = self._nodes.pop(0)
            self.executor.remove_node(node)
            node.destroy_node()


@pytest.fixture(autouse=True, scope="module")
def collect_nodes() -> Iterator[None]:
    """Collect the nodes that the tests of a file made in this process: another file may look for their names."""
    yield
    if "rclpy" in sys.modules:
        gc.collect()


@pytest.fixture
def ros() -> Iterator[RosSession]:
    """Give a ROS session that ends with the test."""
    session = RosSession()
    yield session
    session.close()


@pytest.fixture
def replays() -> Callable[..., set[tuple[str, str]]]:
    """Give a function that requires that a bag replays to the bit, and returns the compared fields by topic.

    If ``node`` is true, it is replayed by a node as well.
    """
    from gdfe_ros.analysis.bag_run import BagRun
    from gdfe_ros.analysis.difference import Difference
    from gdfe_ros.analysis.replay import Replay
    from gdfe_ros.testing.node_replay import NodeReplay

    def check(bag: Path, *, node: bool = False) -> set[tuple[str, str]]:
        run, fields = BagRun(bag), []
        for kind in (Replay, NodeReplay) if node else (Replay,):
            report = kind(run).run()
            assert report.verdict() is Difference.IDENTICAL, (report.unknown, report.differences.differing)
            assert (report.inexact, report.differences.steps) == (0, len(run.records))
            fields.append(set(report.differences.fields))
        return set.intersection(*fields)

    return check


@pytest.fixture
def kept_bags() -> dict[Path, float]:
    """Return a dict from each bag in bags/ to its factor on the tolerance, for replays elsewhere (bags/README.md)."""
    folder = Path(__file__).parents[1] / "bags"
    text = (folder / "README.md").read_text(encoding="utf-8")
    cells = [re.split(r"\s*\|\s*", line) for line in text.splitlines() if line.startswith("| `")]
    return {folder / row[1].strip("`"): float(row[8]) for row in cells}


@pytest.fixture
def kill_one() -> Iterator[Callable[[Client], None]]:
    """Give a function that kills one worker of a dask client, as soon as one is at work."""
    threads = []

    def kill(client: Client) -> None:
        pids = client.run(os.getpid)

        def wait() -> None:
            while not (busy := [worker for worker, tasks in client.processing().items() if tasks]):
                time.sleep(0.01)
            os.kill(pids[busy[0]], signal.SIGKILL)

        threads.append(threading.Thread(target=wait))
        threads[-1].start()

    yield kill
    for thread in threads:
        thread.join()

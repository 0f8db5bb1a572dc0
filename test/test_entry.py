# SPDX-License-Identifier: Apache-2.0
"""Console scripts that are interrupted at their start end without a traceback."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from gdfe_ros.cli import BAD_INPUT, CLOSED, main
from test.written import run_python

ROOT = Path(__file__).parents[1]
# Sends SIGINT to the process in the middle of its imports: when the named module is looked for.
_INTERRUPTER = """
import os, signal, sys
class Interrupter:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), signal.{number})
sys.meta_path.insert(0, Interrupter())
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # it is ignored if the tests run under nohup, and stays ignored
sys.argv[1:] = {arguments!r}
from gdfe_ros import entry
sys.exit(entry.{script}())
"""


@pytest.mark.parametrize(
    ("script", "arguments", "module", "number", "status", "name"),
    [
        ("sim_node", [], "gdfe_ros.simulation", "SIGINT", 0, "sim_node"),
        ("sim_node", [], "gdfe_ros.simulation", "SIGTERM", 0, "sim_node"),
        ("sim_node", [], "gdfe_ros.simulation", "SIGHUP", 0, "sim_node"),
        ("tip_tracking", [], "rclpy", "SIGTERM", 0, "tip_tracking"),
        ("carrying_arm", [], "rclpy", "SIGINT", 0, "carrying_arm"),
        ("gdfe", ["solve", "bend5"], "argparse", "SIGINT", 130, "gdfe"),
        ("gdfe", ["solve", "bend5"], "argparse", "SIGTERM", 143, "gdfe"),
        ("gdfe", ["solve", "bend5"], "numpy", "SIGINT", 130, "gdfe solve"),
    ],
)
def test_an_interrupt_during_the_imports_leaves_no_traceback(
    script: str, arguments: list[str], module: str, number: str, status: int, name: str
) -> None:
    """A signal during the imports gives one line, and the exit status that shells and launch expect."""
    code = _INTERRUPTER.format(script=script, arguments=arguments, module=module, number=number)
    done = run_python(code)
    assert (done.returncode, done.stdout, done.stderr) == (status, "", f"{name}: interrupted while starting\n")


def test_an_interrupt_during_a_command_leaves_no_traceback() -> None:
    """An interrupt of `gdfe solve` during a solve gives one line on stderr and status 130."""
    code = (
        "import os, signal, sys\n"
        "from gdfe_ros import entry\n"
        "from gdfe_ros.simulation import Simulation\n"
        "Simulation.warm_up = lambda self: os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.argv[1:] = ['solve', 'bend5']\n"
        "sys.exit(entry.gdfe())\n"
    )
    done = run_python(code)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "gdfe solve: interrupted\n")


def test_a_mistyped_command_is_guessed(capsys: pytest.CaptureFixture[str]) -> None:
    """A wrong command is told in one line, with the one that was meant, and status 2."""
    assert main(["sovle", "bend5"]) == BAD_INPUT
    assert capsys.readouterr().err == "gdfe: no command 'sovle'; did you mean 'solve'? gdfe --help lists all\n"


def test_an_output_that_is_closed_ends_a_command_quietly() -> None:
    """`gdfe ... | head` ends without a word when its reader has read enough, with the status of SIGPIPE."""
    code = (
        "import sys\n"
        "from gdfe_ros import cli\n"
        "from gdfe_ros.commands import inspect\n"
        "def run(arguments):\n"
        "    while True:\n"
        "        print('line')\n"
        "inspect.run = run\n"
        "sys.exit(cli.main(['inspect', 'x.stl']))\n"
    )
    given = {"cwd": ROOT, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", code], **given) as process:
        assert process.stdout.readline() == "line\n"
        process.stdout.close()
        assert (process.stderr.read(), process.wait(60)) == ("", CLOSED)


def test_the_imports_are_kept_out_of_the_search_for_cycles() -> None:
    """Imports of commands, also failed ones, leave garbage collection enabled and exclude imported objects from it."""
    code = (
        "import gc\n"
        "from gdfe_ros import entry\n"
        "entry.import_uncollected('gdfe_ros.commands.solve')\n"
        "assert gc.isenabled() and gc.get_freeze_count() > 50_000\n"
        "count = gc.get_freeze_count()\n"
        "held = [[] for _ in range(1000)]\n"
        "entry.import_uncollected('gdfe_ros.commands.solve')\n"
        "assert gc.get_freeze_count() <= count\n"
        "try:\n"
        "    entry.import_uncollected('gdfe_ros.nothing_like_it')\n"
        "except ModuleNotFoundError:\n"
        "    print(gc.isenabled())\n"
    )
    done = run_python(code)
    assert (done.returncode, done.stdout, done.stderr) == (0, "True\n", "")

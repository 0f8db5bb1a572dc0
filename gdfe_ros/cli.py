# SPDX-License-Identifier: Apache-2.0
"""The command ``gdfe``."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence

from gdfe_ros import __version__
from gdfe_ros.entry import INTERRUPTED, import_uncollected, quiet_imports
from gdfe_ros.errors import GdfeError
from gdfe_ros.installation import remedy
from gdfe_ros.untrusted.bounded_text import plain_lines
from gdfe_ros.untrusted.spelling import did_you_mean

COMMANDS = {
    "solve": "solve a scene's program, print the result and write it to files",
    "live": "show a running scene in the browser and command it with the mouse",
    "twin": "let a scene follow a real robot's commands, compare both, and fit Young's moduli while they move",
    "demo": "start a node, play a scene's program to it over topics, record a bag and draw a picture",
    "topics": "list topics with types, publishers and subscriptions, without the command ros2",
    "nodes": "list nodes, without the command ros2",
    "params": "print the parameters of a node, or set one, without the command ros2",
    "lifecycle": "print the state of a lifecycle node, or request a transition, without the command ros2",
    "hz": "measure the rate of a topic, without the command ros2",
    "pub": "publish one message on a topic and print refusals, without the command ros2",
    "echo": "print the latest message of a topic, and the next ones if wanted, without the command ros2",
    "call": "call a service and print its answer, without the command ros2",
    "calibrate": "repeat the calibration in Sec. 4.2.1 of the paper and compare it with Eq. 7",
    "replay": "repeat a recorded run, without ROS or through a node, and compare every published array",
    "compare": "compare two recorded runs: whether they differ, where, and by how much",
    "recover": "write a whole bag from a bag that was cut off or damaged",
    "export": "write a recorded run for ParaView, numpy or a table program",
    "report": "write a recorded run as one HTML page that opens offline",
    "inspect": "print the contents and the defects of a mesh or surface file, and draw it",
    "new": "write a scene to start from for a CAD or mesh file",
    "sweep": "run a scene with many values of its keys, in parallel",
    "fit": "fit parameters of a scene to recordings of a robot, or a material to a tensile test",
    "workspace": "find the points that a probe reaches over the ranges of the actuators",
    "compile": "compile the kernels of some scenes, or of all shipped ones, so that the first start is fast",
}
_HOMES = {
    **dict.fromkeys(("topics", "nodes", "params", "lifecycle", "hz", "pub", "echo", "call"), "remote.graph"),
    **dict.fromkeys(("export", "recover", "report"), "bags"),
    "compare": "replay",
    "workspace": "sweep",
}
"""Dict from command to its module in `commands`, if that has another name."""
BAD_INPUT, CLOSED = 2, 141
"""Exit statuses: for bad input, and for an output that its reader has closed (as if SIGPIPE had ended the program)."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a subcommand and return its exit status.

    Returns:
        0 for success; 1 if a subcommand finds a difference, a defect or a failure; 2 for bad input, after one clear
        message; 3 if a solve did not converge; 130 if the subcommand was interrupted.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    if given and given[0] not in COMMANDS and not given[0].startswith("-"):
        guess = did_you_mean(given[0], COMMANDS)
        print(plain_lines(f"gdfe: no command {given[0]!r}; {guess}gdfe --help lists all"), file=sys.stderr)
        return BAD_INPUT
    parser = _parser(given)
    parsed = parser.parse_args(given)
    try:
        return parsed.run(parsed)
    except BrokenPipeError:  # `gdfe echo ... | head` has read enough; the interpreter must not write once more
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return CLOSED
    except (GdfeError, argparse.ArgumentTypeError, ValueError, OSError) as error:
        print(plain_lines(f"gdfe {parsed.command}: {error}"), file=sys.stderr)
        return BAD_INPUT
    except ModuleNotFoundError as error:
        if (text := remedy(error, command=parsed.command)) is None:
            raise
        print(f"gdfe {parsed.command}: {text}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print(f"gdfe {parsed.command}: interrupted", file=sys.stderr)
        return INTERRUPTED


def _parser(given: Sequence[str]) -> argparse.ArgumentParser:
    """Return the parser of the command line; only the module of the requested subcommand is imported."""
    parser = argparse.ArgumentParser(
        prog="gdfe",
        description="Soft-robot simulation by geometry-driven finite elements.",
        epilog="sim_node --ros-args -p scene:=NAME starts the ROS node; sim_node --help lists its parameters.",
    )
    parser.add_argument("--version", action="version", version=f"gdfe_ros {__version__}")
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, text in COMMANDS.items():
        subparser = subparsers.add_parser(name, help=text, description=text)
        if given and given[0] == name:
            with quiet_imports(f"gdfe {name}", INTERRUPTED):
                module = import_uncollected(f"gdfe_ros.commands.{_HOMES.get(name, name)}")
            several = getattr(module, "COMMANDS", {})
            add, run = several[name] if several else (module.add_arguments, module.run)
            add(subparser)
            subparser.set_defaults(run=run)
    return parser


if __name__ == "__main__":
    sys.exit(main())

# SPDX-License-Identifier: Apache-2.0
"""True errors of slender bars that a tendon bends: ``python -m benchmarks.torture.tendons``.

The bars differ in length, cells across, material, kind and size of the command, and number of steps. The true error is
the distance from the same stream at the first tolerance of `TRUTHS`.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import product

from benchmarks.torture.far_steps import ELSEWHERE, show
from benchmarks.torture.honesty import RUBBER, TRUTHS, Stream, error_of, played, tendon_bar

TOLERANCE = 1e-4
RATIOS, CELLS, STEPS = (10.0, 20.0, 40.0), ((20, 1, 1), (30, 2, 2)), (3, 10)
LAWS = (RUBBER.replace("0.499", "0.45"), RUBBER, "preset: dragon_skin_30")
COMMANDS = (("shortening", 0.3), ("shortening", 1.0), ("tension", 0.02))


def errors(stream: Stream) -> Iterator[float]:
    """Yield the true error of each converged step of a stream, divided by the tolerance, up to another equilibrium."""
    size = stream.scene().mesh.size
    for found, true in zip(played(stream, TOLERANCE), played(stream, TRUTHS[0]), strict=True):
        error = error_of(found, true, size)
        if error > ELSEWHERE:
            return
        if found.converged and true.converged:
            yield error / TOLERANCE


def main() -> None:
    """Print the number of steps, how many end farther away than the tolerance, and the largest errors."""
    chosen = product(RATIOS, CELLS, LAWS, COMMANDS, STEPS)
    streams = [Stream(partial(tendon_bar, *bar, *command), steps, steps) for *bar, command, steps in chosen]
    show([error for stream in streams for error in errors(stream)])


if __name__ == "__main__":
    main()

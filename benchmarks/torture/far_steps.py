# SPDX-License-Identifier: Apache-2.0
"""True errors of stocky bars after one far step from rest: ``python -m benchmarks.torture.far_steps [SEED...]``.

Each seed gives forty random bars, 1.5 to 9 times as long as thick. Some sag far under their weight, the others are held
at both ends, bent and turned. The true error is the distance from the same step at the first tolerance of `TRUTHS`. If
that step ends in another equilibrium, more than `ELSEWHERE` of the size away, the two are not compared.
"""

from __future__ import annotations

import sys
from functools import partial

import numpy as np

from benchmarks.torture.honesty import TOLERANCES, TRUTHS, Stream, bar, error_of, held, played

BARS = 40
"""Number of bars of a seed."""
ELSEWHERE = 0.03
"""Distance of another equilibrium, divided by the body's size."""


def random_bar(random: np.random.Generator) -> Stream:
    """Return the single far step of a random bar."""
    ratio, across = float(random.uniform(1.5, 9.0)), int(random.integers(2, 4))
    cells = max(2, round(ratio * across * random.uniform(0.6, 1.0))), across, across
    length, poisson = 0.01 * ratio, float(random.choice([0.3, 0.45, 0.49]))
    shift, turn = random.uniform(-0.25, 0.25, 3).tolist(), random.uniform(-90.0, 90.0, 3).tolist()
    sag, sags = 10.0 ** random.uniform(-2.0, 0.0), random.random() < 0.4
    if sags:
        return Stream(partial(bar, (length, 0.01, 0.01), cells, sag, poisson=poisson), 1, 1)
    return Stream(partial(held, length, cells, poisson, shift, turn), 1, 1)


def errors(seed: int) -> list[float]:
    """Return the errors of the converged steps of a seed's bars, divided by the tolerances."""
    random, found = np.random.default_rng(seed), []
    for stream in [random_bar(random) for _ in range(BARS)]:
        true, size = played(stream, TRUTHS[0])[0], stream.scene().mesh.size
        for tolerance in TOLERANCES:
            result = played(stream, tolerance)[0]
            error = error_of(result, true, size)
            if result.converged and true.converged and error < ELSEWHERE:
                found.append(error / tolerance)
    return found


def show(found: list[float]) -> None:
    """Print the number of errors, how many are beyond the tolerance, and the largest ones; all over the tolerance."""
    largest = ", ".join(f"{error:.2f}" for error in sorted(found)[-5:])
    print(f"{len(found)} converged steps, {sum(error > 1.0 for error in found)} of them beyond the tolerance;", end=" ")
    print("largest errors, divided by the tolerance:", largest)


def main() -> None:
    """Print the number of steps, how many end farther away than the tolerance, and the largest errors."""
    seeds = [int(text) for text in sys.argv[1:]] or [1, 2]
    show([error for seed in seeds for error in errors(seed)])


if __name__ == "__main__":
    main()

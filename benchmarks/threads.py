# SPDX-License-Identifier: Apache-2.0
"""Speed-up by threads: twist90_uniform from 500 to 32 000 elements with one thread and with all threads.

``python -m benchmarks.threads [--out FILE]`` prints the table of docs/benchmark.md. Every number is the median of three
new processes.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from statistics import median
from typing import Any

from benchmarks.markdown import markdown_table
from benchmarks.report import options, write_report
from benchmarks.scaling import SIZES, measure_size, scaling_probe

REPEATS = 3


def measure(cells: tuple[int, int, int], threads: int) -> dict[str, Any]:
    """Solve in turn with one and several threads; return times per iteration [s], and whether results are identical."""
    runs = [(measure_size(cells), measure_size(cells, threads=threads)) for _ in range(REPEATS)]
    one, several = zip(*runs, strict=True)
    return {
        "elements": one[0]["elements"],
        "threads": threads,
        "time_one": median(run["time_iteration"] for run in one),
        "time_several": median(run["time_iteration"] for run in several),
        "equal": len({run["digest"] for run in (*one, *several)}) == 1,
    }


def thread_table(report: Sequence[dict[str, Any]]) -> str:
    """Return the comparison as a Markdown table."""
    heads = (
        "elements",
        "one iteration, 1 thread [ms]",
        f"with {report[0]['threads']} threads [ms]",
        "ratio",
        "same bits",
    )
    rows = [
        (str(item["elements"]), f"{1e3 * item['time_one']:.2f}", f"{1e3 * item['time_several']:.2f}",
         f"{item['time_several'] / item['time_one']:.2f}", "yes" if item["equal"] else "no")
        for item in report
    ]  # fmt: skip
    return markdown_table(heads, rows)


def probe() -> dict[str, float]:
    """Return the figures of the two smallest meshes, solved in this process with one thread and with two."""
    return scaling_probe(SIZES[:2], threads=2)


def main() -> None:
    """Run the measurement, write the report and print the table."""
    given = options("benchmarks.threads", "What threads save.", "threads").parse_args()
    report = [measure(cells, os.cpu_count() or 1) for cells in SIZES[:3]]
    write_report(given.out, report, probe())
    print(thread_table(report))


if __name__ == "__main__":
    main()

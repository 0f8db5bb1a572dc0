# SPDX-License-Identifier: Apache-2.0
"""The table of manners: ``python -m benchmarks.manners [--out FILE]`` checks a node from outside, and writes results.

The checks are those of ``test/manners``, which uses nothing of this package except its messages.
"""

from __future__ import annotations

import json
import subprocess
import sys

from benchmarks.provenance import ROOT
from benchmarks.report import options, write_report

SCRIPT = ROOT / "test" / "manners"


def probe() -> dict[str, float | str]:
    """Return the digest of the checks that the script in ``test/manners`` computes."""
    code = "import runpy, sys; print(runpy.run_path(sys.argv[1])['questions']())"
    command = [sys.executable, "-c", code, str(SCRIPT / "__main__.py")]
    return {"questions": subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()}


def main() -> int:
    """Make all checks; return 1 if a result is not the expected one."""
    given = options("benchmarks.manners", "Ask a node from outside.", "manners").parse_args()
    answers = ROOT / "runs" / "manners.json"
    answers.unlink(missing_ok=True)
    status = subprocess.run([sys.executable, str(SCRIPT)], cwd=ROOT, check=False).returncode
    if not answers.is_file():
        print("the questions were not asked to the end; nothing is written", file=sys.stderr)
        return status or 1
    write_report(given.out, json.loads(answers.read_text(encoding="utf-8")), probe())
    return status


if __name__ == "__main__":
    sys.exit(main())

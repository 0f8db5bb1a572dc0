# SPDX-License-Identifier: Apache-2.0
"""Drive a node from outside, with nothing of this package but its messages: ``python test/manners [group ...]``.

Prints a table of what was asked, expected and found, and leaves it in runs/manners.json, where groups asked alone
replace theirs; exit status 1 where any two differ.
"""

from __future__ import annotations

import ast
import hashlib
import json
import signal
import sys
from pathlib import Path

FOLDER = Path(__file__).parent
QUESTIONS = (FOLDER / "asked.py", FOLDER / "systems.py", FOLDER / "troubles.py")
REPORT = FOLDER.parents[1] / "runs" / "manners.json"


def questions() -> str:
    """Give the mark of the questions: it changes with them, and not with comments or the lines' lengths."""
    text = "".join(ast.dump(ast.parse(path.read_text(encoding="utf-8"))) for path in QUESTIONS)
    return hashlib.sha256(text.encode()).hexdigest()


def keep(found: dict[str, list[tuple[str, str, str]]], order: list[str]) -> None:
    """Write the report; groups that were not asked now stay as they were, if these very questions were asked then."""
    kept: dict[str, list[list[str]]] = {}
    if REPORT.exists() and (report := json.loads(REPORT.read_text(encoding="utf-8")))["questions"] == questions():
        for group, *row in report["rows"]:
            kept.setdefault(group, []).append(row)
    rows = [(group, *row) for group in order for row in {**kept, **found}.get(group, [])]
    REPORT.parent.mkdir(exist_ok=True)
    REPORT.write_text(json.dumps({"questions": questions(), "rows": rows}, indent=1) + "\n", encoding="utf-8")


def main(names: list[str]) -> int:
    """Ask all, or the groups named."""
    import asked
    import systems
    import troubles

    # A shell that starts this in the background has it ignore SIGINT, and every node that is asked with it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    groups = {group.__name__: group for group in (*asked.GROUPS, *systems.GROUPS, *troubles.GROUPS)}
    if unknown := ", ".join(set(names) - set(groups)):
        print(f"no group {unknown}; there are {', '.join(groups)}", file=sys.stderr)
        return 2
    found: dict[str, list[tuple[str, str, str]]] = {}
    print("| asked | expected | found |\n|---|---|---|", flush=True)
    for name in names or groups:
        found[name] = []
        for row in groups[name]():
            found[name].append(row)
            mark = "" if row[1] == row[2] else " (differs)"
            print(f"| {' | '.join(row)}{mark} |", flush=True)
    rows = [row for group in found.values() for row in group]
    differing = sum(expected != answer for _, expected, answer in rows)
    print(f"\n{len(rows)} questions, {differing} differences", flush=True)
    keep(found, list(groups))
    return int(differing > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

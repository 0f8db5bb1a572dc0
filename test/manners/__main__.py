# SPDX-License-Identifier: Apache-2.0
"""Drive a node from outside, with nothing of this package but its messages: ``python test/manners [group ...]``.

Prints a table of what was asked, expected and found; exit status 1 where any two differ.
"""

from __future__ import annotations

import sys

from asked import GROUPS


def main(names: list[str]) -> int:
    """Ask all, or the groups named."""
    differing = 0
    print("| asked | expected | found |\n|---|---|---|", flush=True)
    for group in GROUPS:
        if names and group.__name__ not in names:
            continue
        for asked, expected, found in group():
            mark = "" if found == expected else " (differs)"
            differing += bool(mark)
            print(f"| {asked} | {expected} | {found}{mark} |", flush=True)
    print(f"\n{differing} differences", flush=True)
    return int(differing > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

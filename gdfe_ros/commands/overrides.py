# SPDX-License-Identifier: Apache-2.0
"""Overrides of a scene on the command line."""

from __future__ import annotations

import argparse
from collections.abc import Iterable


def read_overrides(pairs: Iterable[str]) -> dict[str, str]:
    """Return dict from key to value of ``KEY=VALUE`` entries. Values remain text; the scene parses them as YAML.

    Raises:
        argparse.ArgumentTypeError: an entry has no ``=``.
    """
    overrides = {}
    for pair in pairs:
        key, separator, value = pair.partition("=")
        if not separator:
            raise argparse.ArgumentTypeError(f"expected KEY=VALUE, got {pair!r}")
        overrides[key.strip()] = value.strip()
    return overrides

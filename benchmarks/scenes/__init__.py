# SPDX-License-Identifier: Apache-2.0
"""Scenes of the benchmarks as text: ``NAME.yaml``, or ``NAME.yaml.in`` with places in braces for `str.format`."""

from __future__ import annotations

from pathlib import Path


def read_scene(name: str) -> str:
    """Return the text of a file of this folder."""
    return Path(__file__).with_name(name).read_text(encoding="utf-8")

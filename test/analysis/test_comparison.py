# SPDX-License-Identifier: Apache-2.0
"""Comparison of two bags."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gdfe_ros.analysis.difference import Difference, compare_bags
from gdfe_ros.cli import main
from gdfe_ros.scene import load_scene


def test_equal_runs_are_equal(make_bag: Callable[..., Path]) -> None:
    """Two recordings of the same run are bit-identical, with exit status 0."""
    first, second = make_bag("a"), make_bag("b")
    assert compare_bags(first, second).differences.verdict() is Difference.IDENTICAL
    assert main(["compare", str(first), str(second)]) == 0


def test_a_changed_modulus_is_found(make_bag: Callable[..., Path], capsys: Any) -> None:
    """Another modulus is reported with its scene key, the first stamp and the size of the difference."""
    first, second = make_bag("a"), make_bag("b", materials__e40__young=41e3)
    comparison = compare_bags(first, second)
    assert comparison.scene_changes == {"materials.e40.young": (40e3, 41e3)}
    assert comparison.differences.fields["mesh", "z"].first.stamp == pytest.approx(0.02)
    assert main(["compare", str(first), str(second)]) == 1
    assert "materials.e40.young: 40000.0 -> 41000.0" in capsys.readouterr().out


def test_a_shorter_run_is_different(make_bag: Callable[..., Path]) -> None:
    """A run without the last step is different, although the common steps are identical."""
    first, second = make_bag("a"), make_bag("b", heights=np.linspace(0.0, 0.1, 6)[:5])
    comparison = compare_bags(first, second)
    assert comparison.only == (1, 0)
    assert comparison.differences.verdict() is Difference.IDENTICAL
    assert main(["compare", str(first), str(second)]) == 1


def test_names_of_nodes_do_not_matter(make_bag: Callable[..., Path], maker: Any, tmp_path: Path) -> None:
    """Runs of nodes with different names are equal: topics are paired without the node's name."""
    scene = load_scene("bend5", overrides={"mesh.bar.cells": [10, 1, 1]})
    bags = [maker(tmp_path / name, scene, node=f"{name}/sim") for name in ("left", "right")]
    for bag in bags:
        bag.step()
    assert main(["compare", *(str(bag.close()) for bag in bags)]) == 0


def test_another_kind_of_bag_is_refused(tmp_path: Path, capsys: Any) -> None:
    """A directory without a bag gives exit status 2 and one clear line."""
    assert main(["compare", str(tmp_path), str(tmp_path)]) == 2
    assert "neither a bag directory nor an MCAP file" in capsys.readouterr().err

# SPDX-License-Identifier: Apache-2.0
"""Replays of recorded runs."""

from __future__ import annotations

import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gdfe_ros.analysis.bag_run import BagRun, BagSteps
from gdfe_ros.analysis.difference import Difference
from gdfe_ros.analysis.replay import Replay
from gdfe_ros.cli import main
from gdfe_ros.constraints import Pose
from gdfe_ros.errors import SceneError
from gdfe_ros.live.bag import StepBag
from gdfe_ros.node.interface.topics import COMMANDS, PROBE
from gdfe_ros.scene import load_scene
from gdfe_ros.solver.matrix.constant_matrix import Factor
from test.analysis.conftest import COARSE, BagMaker, rewrite


def _pose(z: float) -> dict[str, Pose]:
    return {"tip": Pose(translation=(0.0, 0.0, z))}


def test_a_replay_is_bit_identical(make_bag: Callable[..., Path]) -> None:
    """A replay of the node's messages has the same bits in every array of every topic."""
    report = Replay(BagRun(make_bag())).run()
    assert report.differences.verdict() is Difference.IDENTICAL
    assert report.differences.steps == 6
    topics = {topic for topic, _ in report.differences.fields}
    assert topics == {
        "step_record",
        "mesh",
        "strain",
        *(f"handles/{h}/{t}" for h in ("base", "tip") for t in ("pose", "wrench")),
    }
    assert not report.unknown
    assert not report.strays


def test_messages_of_a_step_may_come_in_any_order(make_bag: Callable[..., Path], tmp_path: Path) -> None:
    """A bag in which the messages of each step are in the opposite order is replayed bit-identically."""
    other = rewrite(
        make_bag(), tmp_path / "other", order=lambda found: sorted(reversed(found), key=lambda each: each.log_time)
    )
    report = Replay(BagRun(other)).run()
    assert report.verdict() is Difference.IDENTICAL
    assert report.differences.steps == 6


def test_a_reset_is_replayed(maker: Any, tmp_path: Path) -> None:
    """A run with a reset, whose stamps restart at zero, is replayed bit-identically."""
    bag = maker(tmp_path / "bag", load_scene("bend5", overrides={"mesh.bar.cells": [10, 1, 1]}))
    bag.step(_pose(0.02))
    bag.step(_pose(0.04))
    bag.reset()
    bag.step(_pose(0.03))
    differences = Replay(BagRun(bag.close())).run().differences
    assert differences.verdict() is Difference.IDENTICAL
    assert differences.steps == 3


def test_one_changed_modulus_is_found_at_its_stamp(make_bag: Callable[..., Path], capsys: Any) -> None:
    """With one changed modulus, the material's fields differ from the first stamp, positions from the first motion."""
    bag = make_bag()
    assert main(["replay", str(bag), "--set", "materials.e40.young=41e3"]) == 1
    shown = capsys.readouterr().out
    assert "different" in shown
    assert "first divergent stamp: 0.01 s" in shown
    differences = Replay(BagRun(bag), overrides={"materials.e40.young": 41e3}).run().differences
    tangent, height = differences.fields["strain", "tangent"], differences.fields["mesh", "z"]
    assert tangent.first.stamp == pytest.approx(0.01)
    centroids = load_scene("bend5", overrides={"mesh.bar.cells": [10, 1, 1]}).mesh.centroids
    assert 0.3 < centroids[tangent.first.element, 0] < 0.4
    assert height.first.stamp == pytest.approx(0.02)
    assert 1e-5 < height.largest < 1e-3
    assert height.differing == 5


def test_another_tolerance_is_within_its_bound(make_bag: Callable[..., Path]) -> None:
    """A replay at 1e-8 of a run at 1e-5 has other bits, but differs by less than ten recorded tolerances."""
    bag = make_bag(solver__tolerance=1e-5)
    assert main(["replay", str(bag), "--tolerance", "1e-8"]) == 1
    assert main(["replay", str(bag), "--tolerance", "1e-8", "--within", "10"]) == 0
    assert main(["replay", str(bag), "--within", "-1"]) == 2
    assert main(["replay", str(bag), "--set", "materials.e40.young=41e3", "--within", "10"]) == 1


def test_another_mesh_is_compared_where_it_can_be(make_bag: Callable[..., Path]) -> None:
    """In a replay on a finer mesh, mesh arrays are counted as resized, and wrenches are compared."""
    differences = Replay(BagRun(make_bag()), overrides={"mesh.bar.cells": [20, 2, 2]}).run().differences
    assert differences.fields["mesh", "x"].resized == 6
    assert differences.verdict(factor=1e9) is Difference.DIFFERENT
    force = differences.fields["handles/tip/wrench", "wrench.force.z"]
    assert 0.0 < force.largest < 0.1 * force.scale


def test_a_policy_that_does_not_exist_is_refused(make_bag: Callable[..., Path]) -> None:
    """An override with an invalid value gives the scene's error without a traceback."""
    with pytest.raises(SceneError, match="policy"):
        Replay(BagRun(make_bag()), overrides={"solver.policy": "fast"})


def test_the_beginning_before_a_hole_is_replayed(maker: Any, tmp_path: Path, capsys: Any) -> None:
    """A run without the record of a step is replayed bit-identically up to that step, and reported as incomplete."""
    bag = maker(tmp_path / "bag", load_scene("bend5", overrides={"mesh.bar.cells": [10, 1, 1]}))
    bag.step(_pose(0.02))
    bag.step(_pose(0.03))
    bag.skip()
    bag.step(_pose(0.04))
    report = Replay(BagRun(bag.close())).run()
    assert report.differences.verdict() is Difference.IDENTICAL
    assert report.verdict() is Difference.INCOMPLETE
    assert report.differences.steps == 2
    assert "ends with step 1, t = 0.02 s, 2 of 3 steps" in report.end
    assert "steps 2 to 2 were dropped or lost" in report.end
    assert main(["replay", str(tmp_path / "bag")]) == 1
    assert "incomplete, bit-identical as far as it was compared" in capsys.readouterr().out


def test_a_run_that_no_node_can_repeat_is_refused(make_bag: Callable[..., Path], capsys: Any) -> None:
    """A replay with ``--ros`` is refused for a run that starts with a command: a node publishes its state first."""
    assert main(["replay", str(make_bag()), "--ros"]) == 2
    assert "replay it without --ros" in capsys.readouterr().err


def test_one_flipped_bit_is_found(make_bag: Callable[..., Path]) -> None:
    """A difference in the last bit of one number is found with its place and size."""
    run = BagRun(make_bag())
    differences = Replay(run).run().differences
    first = np.arange(5, dtype=np.float32)
    second = first.copy()
    second[3] = np.nextafter(second[3], np.float32(9))
    differences.add((7, 0), {"mesh": {"x": first}}, {"mesh": {"x": second}})
    entry = differences.fields["mesh", "x"]
    assert (entry.first.key, entry.first.element) == ((7, 0), 3)
    assert entry.largest == pytest.approx(float(np.spacing(np.float32(3))))


def test_every_bag_of_the_repository_replays(kept_bags: dict[Path, float]) -> None:
    """Every bag in bags/ replays within the factor that its README states."""
    bags = list(kept_bags)
    assert {bag.name for bag, factor in kept_bags.items() if factor > 10} == {"bend5_wall"}
    assert {bag.name for bag in bags} == {path.parent.name for path in bags[0].parent.glob("*/metadata.yaml")}
    assert sum(file.stat().st_size for bag in bags for file in bag.iterdir()) < 5e6
    for bag in bags:
        run = BagRun(bag)
        assert run.scene.solver.tolerance == 1e-8
        report = Replay(run).run()
        verdict = report.differences.verdict(kept_bags[bag])
        assert verdict is not Difference.DIFFERENT, (bag.name, report.differences.factor_needed())
        assert not report.unknown


def test_a_bag_replays_with_another_factorisation(kept_bags: dict[Path, float], monkeypatch: Any) -> None:
    """A replay with the constant matrix in single precision is within the tolerance times the bag's factor."""
    monkeypatch.setattr(Factor, "COARSE_FROM", 1)
    bag, factor = next((bag, factor) for bag, factor in kept_bags.items() if bag.name == "twist90")
    differences = Replay(BagRun(bag)).run().differences
    assert differences.verdict() is Difference.DIFFERENT
    assert differences.verdict(factor) is Difference.WITHIN, differences.factor_needed()


def test_the_recorder_of_the_bags_writes_their_table(kept_bags: dict[Path, float]) -> None:
    """Each bag's row by the script of ``make bags`` is in bags/README.md, except for the times."""
    folder = next(iter(kept_bags)).parent
    script = runpy.run_path(str(folder / "record.py"), run_name="record")
    readme = (folder / "README.md").read_text(encoding="utf-8")
    for bag in kept_bags:
        assert script["row"](bag.name).rsplit("|", 3)[0] in readme


def test_commands_in_a_bag_are_no_part_of_its_steps(tmp_path: Path, maker: type[BagMaker]) -> None:
    """No command topic of the node is compared; a probe that has the name of a command topic is."""
    commands = {spec.key(handle="tip", obstacle="ball", body="cube"): spec.type for spec in COMMANDS}
    others = commands | {"probe/commands": PROBE.type}
    scene, given = maker.coarse(), {"node": "gdfe_sim", "settings": {}, "texts": {}, "others": others}
    StepBag(tmp_path / "bag", scene, **given).close()
    found = BagSteps(BagRun(tmp_path / "bag")).topics
    assert not commands.keys() & found.keys()
    assert "probe/commands" in found


def test_a_probe_may_have_the_name_of_another_topic(tmp_path: Path, maker: type[BagMaker]) -> None:
    """Messages of a probe with the name of another topic are not taken for those of this topic."""
    scene = load_scene(
        "bend5", overrides={**COARSE, "probes": {name: [0.1, 0.0, 0.0] for name in ("step_record", "wrench")}}
    )
    bag = maker(tmp_path / "bag", scene)
    bag.step({"tip": Pose((0.0, 0.0, 0.01))})
    run = BagRun(bag.close())
    assert len(run.records) == 1
    assert set(run.last_wrenches()) == {"base", "tip"}
    assert Replay(run).run().verdict() is Difference.IDENTICAL

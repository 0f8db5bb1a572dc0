# SPDX-License-Identifier: Apache-2.0
"""Scenes as Gymnasium environments."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.utils.seeding import np_random

from benchmarks.environments import TOO_LARGE, explored_scenes
from gdfe_ros.errors import CommandError, GdfeError
from gdfe_ros.scene import load_scene, scene_from_text, scene_names
from gdfe_ros.testing import make_env, make_vector_env
from gdfe_ros.testing.environment import SoftRobotEnv

BAR = """
name: bar
mesh: {bar: {size: [0.1, 0.02, 0.02], cells: [5, 1, 1]}}
materials: {rubber: {law: neo_hookean, young: 0.5e6, poisson: 0.45, density: 1000}}
regions: [{material: rubber}]
handles: {base: {where: {face: x-}, fixed: true}}
actuators:
  lower: {cable: {points: [[0, 0, -0.008], [0.1, 0, -0.008]], range: [0, 2]}}
  left: {cable: {points: [[0, 0.008, 0], [0.1, 0.008, 0]], range: [0, 1]}}
probes: {tip: [0.1, 0, 0]}
"""
HEAVY = BAR + "loads: {weight: {gravity: [0, 0, -9.81]}}\n"
MOVING = f"{BAR}dynamics: {{step: 0.01, damping: {{viscosity: 100.0}}}}"


@pytest.mark.parametrize(("text", "mode"), [(BAR, None), (MOVING, None), (BAR, "rgb_array")])
def test_gymnasium_finds_nothing_to_complain_of(text: str, mode: str | None) -> None:
    """Gymnasium's checker accepts an environment of equilibria, one of motion, and one with pictures."""
    env = _env(text, dt=0.01, render_mode=mode)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        # Its advice, for commands in SI units and observations without bounds; `RescaleAction` is for who wants it.
        warnings.filterwarnings("ignore", message=".*(symmetric and normalized|infinity|different from the unwrapped)")
        if mode:
            warnings.filterwarnings("ignore", message=".*a spec")
        check_env(env, skip_render_check=mode is None)
    env.close()


def test_episodes_with_the_same_seed_are_the_same() -> None:
    """Two episodes with one seed have the same goals, observations and rewards bit for bit; another seed differs."""
    first, second = (_episode(_env(BAR), seed=7) for _ in range(2))
    np.testing.assert_array_equal(first, second)
    assert not np.array_equal(first, _episode(_env(BAR), seed=8))


def test_the_goal_is_reached_by_a_command() -> None:
    """The command from which a goal was drawn moves the tip within a hundredth of the initial distance to it."""
    env = _env(BAR, dt=1.0)
    env.reset(seed=3)
    drawn = np_random(3)[0].uniform(env.action_space.low, env.action_space.high)
    start = -env.step([0.0, 0.0])[1]
    assert -env.step(drawn)[1] < 0.01 * start


def test_callables_of_ones_own_decide() -> None:
    """Own functions give observation, reward and end: the space has the observation's shape, and the episode ends."""
    env = _env(
        BAR,
        observation=lambda simulation: simulation.probe_positions()["tip"][[0, 2]],
        reward=lambda simulation, action: -float(action.sum()),
        terminated=lambda simulation: simulation.time > 0.09,
    )
    seen, _ = env.reset()
    assert env.observation_space.shape == seen.shape == (2,)
    assert env.goal is None
    _, reward, terminated, _, _ = env.step([2.0, 1.0])
    assert (reward, terminated) == (-3.0, False)
    assert env.step([2.0, 1.0])[2]


def test_commands_beyond_the_range_count_as_its_end() -> None:
    """A command of 1000 N with a range up to 2 N gives 2 N."""
    env = _env(BAR, dt=1.0)
    env.reset()
    env.step([1000.0, -5.0])
    states = env.simulation.actuator_states()
    assert [states[name].command for name in ("lower", "left")] == [2.0, 0.0]


@pytest.mark.parametrize("action", [[np.nan, 0.0], [1.0], [[1.0, 2.0]]])
def test_what_is_no_command_is_refused(action: Any) -> None:
    """NaN and wrong shapes are refused with the actuators' names, and the state stays."""
    env = _env(BAR)
    env.reset()
    with pytest.raises(CommandError, match="lower"):
        env.step(action)
    assert env.simulation.time == 0.0


def test_a_step_that_does_not_converge_truncates() -> None:
    """If no step converges, not even without a new command, the episode is truncated with the reason."""
    env = _env(BAR, reward=lambda simulation, action: 0.0)
    env.reset()
    solve, tried = env.simulation.step, []

    def failing(command: Any, **options: Any) -> Any:
        tried.append(command.actuators["lower"])
        return replace(solve(command, **options), converged=False, message="nothing works")

    env.simulation.step = failing
    _, _, terminated, truncated, info = env.step([2.0, 0.0])
    assert (terminated, truncated, info["converged"]) == (False, True, False)
    assert info["why"] == "not converged: nothing works"
    np.testing.assert_allclose(tried, [0.1, 0.0125, 0.0])


def test_the_last_step_truncates() -> None:
    """Only the last step of an episode truncates it."""
    env = _env(BAR, steps=3)
    env.reset()
    steps = [env.step([1.0, 0.0]) for _ in range(3)]
    assert [step[3] for step in steps] == [False, False, True]
    assert steps[-1][4]["why"] == "3 steps are over"


def test_scenes_that_lack_something_are_refused() -> None:
    """Scenes without actuators, ranges or probes are refused with what is missing and its key."""
    with pytest.raises(GdfeError, match="no actuators"):
        make_env("bend5")
    with pytest.raises(GdfeError, match="left of scene 'bar' have no range"):
        _env(BAR.replace(", range: [0, 1]", ""))
    with pytest.raises(GdfeError, match="no probes"):
        _env(BAR.replace("probes: {tip: [0.1, 0, 0]}", ""))


@pytest.mark.parametrize(("scene", "steps"), [("three_chamber_arm", 30), ("crawler", 30)])
def test_random_actions_explore_shipped_scenes(scene: str, steps: int) -> None:
    """With random actions every step converges, no command jumps, and goals and observations are finite."""
    assert _flaws(scene, steps) == []


@pytest.mark.parametrize("scene", ["grasp", "soft_pinch"])
def test_a_goal_of_a_scene_with_a_free_body_is_found_in_motion(scene: str) -> None:
    """In a scene that needs dynamics, a reset finds a goal near the probe, and the steps after it converge."""
    env = make_env(scene)
    env.reset(seed=0)
    start = env.simulation.probe_positions()["left_tip"]
    assert 0.0 < np.linalg.norm(env.goal - start) < 0.02
    assert all(env.step(env.action_space.high)[4]["converged"] for _ in range(3))


@pytest.mark.slow
@pytest.mark.parametrize("scene", explored_scenes())
def test_random_actions_explore_every_shipped_scene(scene: str) -> None:
    """In each scene with actuators and probes, gymnasium's check and 1000 random actions pass; all steps converge."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        check_env(make_env(scene), skip_render_check=True)
    assert _flaws(scene, 1000) == []


def test_the_list_of_scenes_to_explore_is_complete() -> None:
    """The explored scenes are all shipped ones that have actuators with ranges and probes, except the largest."""
    scenes = [load_scene(name) for name in scene_names()]
    fit = [
        scene.name
        for scene in scenes
        if scene.actuators and scene.probes and all(np.isfinite(each.high - each.low) for each in scene.actuators)
    ]
    assert sorted(fit) == sorted([*explored_scenes(), *TOO_LARGE])


def test_actions_are_rate_limited() -> None:
    """A command over the whole range is applied by a twentieth in each step, or at once with a slew time of zero."""
    env = _env(BAR)
    env.reset(seed=1)
    seen = [env.step([2.0, 0.5])[4]["applied"] for _ in range(3)]
    np.testing.assert_allclose(seen, [[0.1, 0.05], [0.2, 0.1], [0.3, 0.15]])
    env = _env(BAR, slew_time=0.0)
    env.reset(seed=1)
    np.testing.assert_allclose(env.step([2.0, 0.5])[4]["applied"], [2.0, 0.5])


def test_a_step_that_would_not_converge_goes_as_far_as_one_does() -> None:
    """If only changes below 0.3 N converge, a commanded change of 2 N is halved to 0.25 N, which converges."""
    env = _env(BAR, slew_time=0.0)
    env.reset(seed=1)
    solve = env.simulation.step

    def strict(command: Any, **options: Any) -> Any:
        leap = abs(command.actuators["lower"] - env.simulation.commands["lower"])
        return replace(solve(command, **options), converged=leap < 0.3)

    env.simulation.step = strict
    info = env.step([2.0, 0.0])[4]
    assert info["converged"]
    np.testing.assert_allclose(info["applied"], [0.25, 0.0])


@pytest.mark.parametrize("text", [BAR, MOVING])
def test_a_reset_to_a_moment_makes_no_solve(text: str) -> None:
    """A reset to a moment of an episode, in any environment of the scene, needs no solve, and later steps are equal."""
    env, other = _env(text, dt=0.01), _env(text, dt=0.01)
    env.reset(seed=3)
    env.step([2.0, 0.0])
    moment = env.snapshot()
    first = [env.step([1.0, 0.5])[:2] for _ in range(3)]
    for each in (env, other):
        solve = each.simulation.step
        each.simulation.step = each._walker.step = _refuse
        seen, info = each.reset(options={"episode": moment})
        each.simulation.step = solve
        assert info["time"] == moment.state.time == 0.01
        assert np.array_equal(each.goal, moment.goal)
        again = [each.step([1.0, 0.5])[:2] for _ in range(3)]
        for (seen, reward), (seen_again, reward_again) in zip(first, again, strict=True):
            np.testing.assert_array_equal(seen, seen_again)
            assert reward == reward_again
    given = (0.1, 0.0, 0.01)
    env.reset(options={"episode": moment, "goal": given})
    assert tuple(env.goal) == given


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"gaol": (0.1, 0.0, 0.0)}, "'gaol'; allowed: 'episode', 'goal'"),
        ({"episode": 5}, "5; allowed: a value of env.snapshot"),
        ({"goal": (0.1, np.nan, 0.0)}, "three finite numbers"),
    ],
)
def test_wrong_options_of_a_reset_are_refused(options: dict[str, Any], told: str) -> None:
    """Unknown options and wrong values of a reset are refused with what is allowed, and the state stays."""
    env = _env(BAR)
    env.reset(seed=1)
    env.step([1.0, 0.0])
    with pytest.raises(GdfeError, match=re.escape(told)):
        env.reset(options=options)
    assert env.simulation.time == 0.05


def test_a_range_is_narrowed_whatever_the_program_commands() -> None:
    """A range smaller than the program's commands is accepted, and limits the actions."""
    env = make_env("tendon_finger", overrides={"actuators.flexor.cable.range": [0.0, 0.5]})
    assert env.action_space.high[0] == 0.5


def test_a_count_of_any_whole_number_type_is_taken() -> None:
    """The number of steps may be numpy's int64; a value that is no count is refused."""
    assert _env(BAR, steps=np.int64(5)) is not None
    for wrong in (0, 2.5, True, "5"):
        with pytest.raises(GdfeError, match="allowed: whole numbers, 1 or more"):
            _env(BAR, steps=wrong)


def test_processes_agree_with_a_single_environment(tmp_path: Path) -> None:
    """Two environments in processes have the rewards that each seed has alone."""
    path = tmp_path / "bar.yaml"
    path.write_text(BAR, encoding="utf-8")
    vector = make_vector_env(str(path), 2)
    try:
        vector.reset(seed=[7, 8])
        rewards = np.array([vector.step(np.full((2, 2), 0.3 * k))[1] for k in range(3)])
    finally:
        vector.close()
    for place, seed in enumerate((7, 8)):
        env = _env(BAR)
        env.reset(seed=seed)
        alone = [env.step([0.3 * k, 0.3 * k])[1] for k in range(3)]
        np.testing.assert_array_equal(rewards[:, place], alone)


def _flaws(scene: str, steps: int) -> list[str]:
    """Make random actions; return the steps that fail, end the episode, jump, or give numbers that are not finite."""
    env = make_env(scene, steps=steps + 1)
    seen, _ = env.reset(seed=0)
    env.action_space.seed(0)
    last, allowed = env._approach.applied, 0.05 * (env.action_space.high - env.action_space.low)
    found = []
    for count in range(steps):
        seen, reward, _, truncated, info = env.step(env.action_space.sample())
        checks = {
            "converged": info["converged"],
            "goes on": not truncated,
            "finite": np.isfinite(seen).all() and np.isfinite(reward),
            "no jump": (abs(info["applied"] - last) <= allowed * (1.0 + 1e-9)).all(),
        }
        found += [f"step {count} is not: {name}; {info}" for name, passed in checks.items() if not passed]
        last = info["applied"]
    return found


def _env(text: str, **options: Any) -> SoftRobotEnv:
    return make_env(scene_from_text(text, origin="of a test"), **options)


def _refuse(*_: Any, **__: Any) -> None:
    raise AssertionError("a step was solved")


def _episode(env: Any, *, seed: int) -> np.ndarray:
    seen = [env.reset(seed=seed)[0]]
    for value in (0.5, 2.0, 1.0):
        now, reward, *_ = env.step([value, 0.0])
        seen.append(np.append(now, reward)[: len(seen[0])])
        seen.append(np.append(now, reward)[-len(seen[0]) :])
    return np.array(seen)


@pytest.mark.parametrize("text", [HEAVY, f"{HEAVY}dynamics: {{step: 0.01, damping: {{viscosity: 100.0}}}}"])
def test_a_reset_observes_the_equilibrium(text: str) -> None:
    """A zero action after a reset moves the tip by less than 3 % of its sag, and each reset observes the same bits."""
    env = _env(text, dt=0.05)
    seen, info = env.reset(seed=1)
    assert info["time"] == 0.0
    sag = -seen[2]
    assert sag > 5e-3
    moved = env.step([0.0, 0.0])[0][2] - seen[2]
    assert abs(moved) < 0.03 * sag
    env.step([2.0, 1.0])
    np.testing.assert_array_equal(env.reset(seed=1)[0], seen)


@pytest.mark.parametrize("scene", ["tendon_finger", "pneunet", "finger_press", "gripper"])
def test_observations_lie_in_bounds(scene: str) -> None:
    """The space of the default observation is bounded, and random actions stay in it without being cut off."""
    env = make_env(scene)
    assert np.isfinite(env.observation_space.low).all()
    assert np.isfinite(env.observation_space.high).all()
    seen, _ = env.reset(seed=0)
    env.action_space.seed(0)
    for _ in range(5):
        assert env.observation_space.contains(seen)
        inside = (seen > env.observation_space.low) & (seen < env.observation_space.high)
        assert inside[: 3 * len(env.simulation.scene.probes)].all()
        seen = env.step(env.action_space.sample())[0]


def test_pictures_without_a_window() -> None:
    """`rgb_array` gives a picture of the body that changes when the body moves, and is the same for the same state."""
    env = _env(BAR, dt=1.0, render_mode="rgb_array")
    env.reset(seed=0)
    first, again = env.render(), env.render()
    np.testing.assert_array_equal(first, again)
    assert first.shape == (480, 640, 3)
    assert first.dtype == np.uint8
    coloured = (np.ptp(first.astype(int), axis=2) > 20).mean()
    assert 0.01 < coloured < 0.5
    env.step([2.0, 0.0])
    assert np.abs(env.render().astype(int) - first).mean() > 0.5
    env.close()
    assert _env(BAR).render() is None
    with pytest.raises(GdfeError, match="render_mode is 'human'; allowed: None, 'rgb_array'"):
        _env(BAR, render_mode="human")


def test_pictures_without_a_display_come_without_a_warning(tmp_path: Path) -> None:
    """On a machine without a display, a picture is drawn, and VTK's warning about the X server is left out."""
    (tmp_path / "bar.yaml").write_text(BAR, encoding="utf-8")
    code = (
        "import sys; from gdfe_ros.testing import make_env; env = make_env(sys.argv[1], render_mode='rgb_array'); "
        "env.reset(seed=0); print(env.render().shape)"
    )
    without = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
    command = [sys.executable, "-c", code, str(tmp_path / "bar.yaml")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True, env=without)
    assert done.stdout == "(480, 640, 3)\n"
    assert "X server" not in done.stderr


@pytest.mark.parametrize("scene", ["arm_pneunet", "grasp", "tendon_finger"])
def test_pictures_of_scenes_with_more_than_a_body(scene: str) -> None:
    """Obstacles, rigid bodies, arms, chambers and cables are drawn."""
    from gdfe_ros.simulation import Simulation
    from gdfe_ros.testing.render import Painter

    painter = Painter(Simulation(load_scene(scene)))
    assert painter.picture().std() > 10.0
    painter.close()

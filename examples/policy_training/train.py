# SPDX-License-Identifier: Apache-2.0
"""Train a policy to reach random goals, by the cross-entropy method: no library besides Gymnasium and NumPy."""

import numpy as np

from gdfe_ros.testing import make_env

GENERATIONS, POPULATION, ELITE, SEEDS = 8, 12, 3, (0, 1, 2)
env = make_env("finger.yaml", dt=0.1, steps=5, slew_time=0.2)
low, high = env.action_space.low, env.action_space.high


def act(weights: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Return tensions that are affine in the goal, relative to the tip's rest position, in centimetres."""
    goal = np.append(100.0 * (seen[-3:] - (0.10, 0.0, 0.0)), 1.0)
    return np.clip(weights.reshape(2, 4) @ goal, low, high)


def episode(weights: np.ndarray, seed: int) -> float:
    """Return the last distance [m] of the tip to the goal."""
    seen, _ = env.reset(seed=seed)
    truncated = False
    while not truncated:
        seen, reward, _, truncated, _ = env.step(act(weights, seen))
    return -reward


def score(weights: np.ndarray) -> float:
    """Return the mean distance [m] over the training goals."""
    return float(np.mean([episode(weights, seed) for seed in SEEDS]))


random = np.random.default_rng(0)
mean, spread = np.zeros(8), np.full(8, 1.5)
untrained = score(mean)
for generation in range(GENERATIONS):
    tried = mean + spread * random.standard_normal((POPULATION, 8))
    scores = np.array([score(weights) for weights in tried])
    best = tried[np.argsort(scores)[:ELITE]]
    mean, spread = best.mean(axis=0), best.std(axis=0) + 0.05
    print(f"generation {generation}: best {1e3 * scores.min():.2f} mm, mean {1e3 * scores.mean():.2f} mm", flush=True)
trained = score(mean)
print(f"distance to the goals: {1e3 * untrained:.2f} mm untrained, {1e3 * trained:.2f} mm trained")
assert trained < 0.5 * untrained

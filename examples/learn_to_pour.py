"""Learn to pour with CMA-ES: a linear policy of the tilting rate for the Gymnasium environment `surfsup/Pour-v0`.

    python examples/learn_to_pour.py --generations 12

Prints the mean return by generation, and the best policy's shares of water in the glass and spilled. It needs
``pip install 'surfsup[gym]'`` and ``cma``.
"""

import argparse
from concurrent.futures import ThreadPoolExecutor
from threading import local

import cma
import gymnasium
import numpy as np

import surfsup.gym

TARGETS = (0.4, 0.8)
worlds = local()  # an environment for each thread


def play(weights: np.ndarray, target: float) -> tuple[float, float, float]:
    """Return of an episode, and the shares of the water that end in the glass and beside it."""
    if not hasattr(worlds, "environment"):
        worlds.environment = gymnasium.make(surfsup.gym.POUR)
    observation, _ = worlds.environment.reset(seed=0, options={"target": target})
    total, ended = 0.0, False
    while not ended:
        tilting_rate = np.tanh(weights @ np.append(observation, 1))
        action = np.array([tilting_rate, 0], np.float32)  # the cup stays where it is
        observation, reward, terminated, truncated, info = worlds.environment.step(action)
        total, ended = total + float(reward), terminated or truncated
    return total, info["shares"].glass, info["shares"].spilled


def main() -> None:
    """Learn, and print how it goes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--generations", type=int, default=12)
    parser.add_argument("--population", type=int, default=8)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    # A policy that does nothing spills nothing, and little noise makes it no better: begin with one that tilts slowly.
    start = np.zeros(9)  # for the eight observations and a constant
    start[8] = 0.3
    search = cma.CMAEvolutionStrategy(start, 0.3, {"popsize": options.population, "seed": options.seed, "verbose": -9})
    best, best_return = start, -np.inf
    with ThreadPoolExecutor(options.threads) as pool:
        for generation in range(options.generations):
            candidates = search.ask()
            episodes = [(candidate, target) for candidate in candidates for target in TARGETS]
            results = list(pool.map(lambda episode: play(*episode), episodes))
            returns = np.array([result[0] for result in results]).reshape(len(candidates), -1).mean(axis=1)
            search.tell(candidates, -returns)
            if returns.max() > best_return:
                best, best_return = candidates[int(returns.argmax())], float(returns.max())
            print(
                f"generation {generation}: mean return {returns.mean():.3f}, best so far {best_return:.3f}", flush=True
            )
        for target, (total, glass, spilled) in zip(
            TARGETS, pool.map(lambda goal: play(best, goal), TARGETS), strict=True
        ):
            print(f"target {target:.2f}: {glass:.2f} in the glass, {spilled:.2f} spilled, return {total:.3f}")


if __name__ == "__main__":
    main()

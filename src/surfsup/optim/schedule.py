"""How the learning rate goes over a run."""

from __future__ import annotations

import math

from surfsup.training.config import TrainingConfig


def learning_rate(config: TrainingConfig, step: int) -> float:
    """A short linear rise, then a cosine or an exponential from the first to the final rate."""
    if step < config.warm_up:
        return config.learning_rate * (step + 1) / config.warm_up
    share = (step - config.warm_up) / max(1, config.steps - config.warm_up)
    low, high = config.final_learning_rate, config.learning_rate
    if config.schedule == "exponential":
        return high * (low / high) ** share
    return low + 0.5 * (high - low) * (1 + math.cos(math.pi * share))

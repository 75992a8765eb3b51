"""The learning-rate schedule: linear warm-up, then decay."""

from __future__ import annotations

import math

from surfsup.optim.config import OptimizationConfig


def learning_rate(config: OptimizationConfig, step: int) -> float:
    """The learning rate of ``step``, which counts from 0.

    The inverse square root (Vaswani et al. 2017) does not depend on the number of steps, so a run can be stopped and
    continued at any step.
    """
    if step < config.warm_up:
        return config.learning_rate * (step + 1) / config.warm_up
    if config.schedule == "inverse-sqrt":
        return max(config.final_learning_rate, config.learning_rate * math.sqrt(max(1, config.warm_up) / (step + 1)))
    progress = min(1.0, (step - config.warm_up) / max(1, config.steps - config.warm_up))
    low, high = config.final_learning_rate, config.learning_rate
    if config.schedule == "exponential":
        return high * (low / high) ** progress
    return low + 0.5 * (high - low) * (1 + math.cos(math.pi * progress))

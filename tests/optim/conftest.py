from typing import Any

from surfsup.optim.config import OptimizationConfig


def config(**changes: Any) -> OptimizationConfig:
    """The options of ten steps."""
    standard: dict[str, Any] = {
        "steps": 10, "learning_rate": 0.1, "final_learning_rate": 0.01, "warm_up": 0,
        "averaging": 0.9, "validate_every": 4,
    }  # fmt: skip
    return OptimizationConfig(**{**standard, **changes})

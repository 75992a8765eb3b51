"""What training minimises, an objective a file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from surfsup.model.learned_simulator import LearnedSimulator
from surfsup.model.message_passing.simulator import MessagePassingSimulator
from surfsup.training.objectives.acceleration import AccelerationObjective
from surfsup.training.objectives.correction import CorrectionObjective
from surfsup.training.objectives.objective import Batch, Objective

if TYPE_CHECKING:
    from surfsup.training.config import TrainingConfig


def objective_for(model: LearnedSimulator, config: TrainingConfig) -> Objective:
    """What ``model`` is trained by."""
    if isinstance(model, MessagePassingSimulator):
        return AccelerationObjective(model, bf16=config.precision == "bf16")
    return CorrectionObjective(model)


__all__ = ["Batch", "Objective", "objective_for"]

"""The objectives of training, one in each file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from surfsup.learned.base import LearnedSimulator
from surfsup.learned.corrected.simulator import CorrectedSimulator
from surfsup.learned.message_passing.simulator import MessagePassingSimulator
from surfsup.training.objectives.acceleration import AccelerationObjective
from surfsup.training.objectives.correction import CorrectionObjective
from surfsup.training.objectives.objective import Batch, Objective

if TYPE_CHECKING:
    from surfsup.training.config import TrainingConfig


def objective_for(model: LearnedSimulator, config: TrainingConfig) -> Objective:
    """The objective that ``model`` is trained with."""
    if isinstance(model, MessagePassingSimulator):
        return AccelerationObjective(model, bf16=config.precision == "bf16")
    assert isinstance(model, CorrectedSimulator)
    return CorrectionObjective(model)


__all__ = ["Batch", "Objective", "objective_for"]

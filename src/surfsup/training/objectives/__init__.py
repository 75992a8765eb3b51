"""What training minimizes, an objective a file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from surfsup.learned.message_passing.simulator import MessagePassingSimulator
from surfsup.sph.simulator import Simulator
from surfsup.training.objectives.acceleration import AccelerationObjective
from surfsup.training.objectives.correction import CorrectionObjective
from surfsup.training.objectives.objective import Batch, Objective

if TYPE_CHECKING:
    from surfsup.training.config import TrainingConfig


def objective_for(model: Simulator, config: TrainingConfig) -> Objective:
    """What ``model`` is trained by."""
    if isinstance(model, MessagePassingSimulator):
        return AccelerationObjective(model, bf16=config.precision == "bf16")
    return CorrectionObjective(model)


__all__ = ["Batch", "Objective", "objective_for"]

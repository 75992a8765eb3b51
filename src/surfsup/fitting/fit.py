"""The fit of a network to shapes: options, state, and when it has diverged."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import Tensor

from surfsup import __version__
from surfsup.checked.tensors import check_weights
from surfsup.errors import InputError
from surfsup.optim.checkpoint import CheckpointFiles, with_prefix, without_prefix
from surfsup.optim.config import Count, Decay, NonNegative, NonNegativeInt, OptimizationConfig, Positive
from surfsup.optim.loop import Progress, optimize
from surfsup.optim.run import Diverged, Model, Run
from surfsup.sdf.neural.shipped_surfaces import SUFFIX

RUNAWAY_RATIO = 8.0  # a smoothed loss this many times its minimum has diverged
ERROR_RATIO = 3.0  # so has an error this many times the least
SETTLING_STEPS = 50  # before these no loss counts as diverged


class FitConfig(OptimizationConfig):
    """The options of every fit; subclasses add their own."""

    steps: Count = 8_000
    learning_rate: Positive = 5e-4
    final_learning_rate: NonNegative = 1e-5
    warm_up: NonNegativeInt = 100
    averaging: Decay = 0.998
    validate_every: Count = 500


Config = TypeVar("Config", bound=FitConfig)


@dataclass(frozen=True)
class FitError:
    """The error of a fit on points held out from it."""

    value: float

    def __str__(self) -> str:
        return f"error {self.value:.3g}"


class Fit(Run[Config, Model, torch.Generator]):
    """A network that is fitted by Adam. The batches of its loss are drawn from a random generator.

    Attributes:
        best: the averaged parameters with the least error so far, empty before the first validation.
    """

    def __init__(self, config: Config, model: Model, folder: Path) -> None:
        optimizer = torch.optim.Adam(model.parameters(), lr=config.learning_rate, betas=(0.9, 0.99), fused=True)
        super().__init__(config, folder, model, optimizer)
        self.best: dict[str, Tensor] = {}

    @abstractmethod
    def error(self, model: Model) -> float:
        """The error of ``model`` on points held out from the fit."""

    def generator(self, step: int) -> torch.Generator:
        """The random generator of the batch of ``step``."""
        return torch.Generator().manual_seed(self.config.seed * 1_000_003 + step)

    def validate(self) -> FitError:
        """Measure the error of the average and keep it if it is the best so far.

        Raises:
            Diverged: the error is far above the least so far.
        """
        error = self.error(self.average)
        if error < self.best_score:
            self.best_score = error
            self.best = {name: value.detach().clone() for name, value in self.average.state_dict().items()}
        if error > ERROR_RATIO * self.best_score:
            raise Diverged(self.describe_divergence(f"error {error:.4g}"))
        return FitError(error)

    def divergence_message(self, batch: torch.Generator) -> str:
        """The error message for a loss or a gradient that is not finite."""
        return self.describe_divergence("the loss is not a number")

    def describe_divergence(self, reason: str) -> str:
        """What happened, which weights are kept, and what to try."""
        kept = f"the best before it, with error {self.best_score:.4g}, is kept" if self.best else "nothing is kept"
        return (
            f"the fit diverged at step {self.step} ({reason}): {kept}; "
            f"start again with a lower learning_rate={self.config.learning_rate / 4:.2g}"
        )

    def continues(self, config: Config) -> bool:
        """Whether the options are the same but for ``steps``, whose schedule holds from the resumed step on."""
        return config.model_copy(update={"steps": self.config.steps}) == self.config

    def state(self) -> tuple[dict[str, Tensor], dict[str, Any]]:
        """The tensors and counters of a checkpoint."""
        tensors, counters = super().state()
        return tensors | with_prefix("best.", self.best), counters

    def load_state(self, tensors: dict[str, Tensor], counters: dict[str, Any]) -> None:
        """Restore what :meth:`state` returned.

        Raises:
            KeyError, TypeError, ValueError, RuntimeError: something is missing or of another shape.
        """
        super().load_state(tensors, counters)
        self.best = without_prefix("best.", tensors)
        if self.best:
            check_weights(self.model, self.best)

    def provenance(self) -> dict[str, Any]:
        """The origin of the fitted network, for the header of its file."""
        return {
            "version": __version__,
            "steps": self.step,
            "seconds": round(self.seconds, 1),
            "processor_seconds": round(self.processor_seconds, 1),
            "options": self.config.model_dump(),
        }


def run_fit(
    fit: Fit[Config, Model],
    stop: Callable[[], bool] = lambda: False,
    report: Callable[[Progress[FitError]], None] | None = None,
) -> None:
    """Fit until all steps are done or ``stop`` returns True; then validate and leave a checkpoint.

    Raises:
        Diverged: the loss is not finite or has run away; the best weights before are in ``fit.best``.
    """
    first_step, lowest = fit.step, math.inf

    def watch(progress: Progress[FitError]) -> None:
        nonlocal lowest
        lowest = min(lowest, progress.loss)
        if progress.step - first_step > SETTLING_STEPS and progress.loss > RUNAWAY_RATIO * lowest:
            raise Diverged(fit.describe_divergence(f"loss {progress.last_step.loss:.4g}"))
        if report is not None:
            report(progress)

    optimize(fit, fit.generator, fit.validate, stop, watch)
    if fit.step > fit.validated_step:
        fit.validate()
        fit.save()


def fit_folder(out: Path, resume: bool) -> Path:
    """The folder of the checkpoints of a fit, beside its output file ``out``.

    Raises:
        InputError: ``out`` has another suffix, or the folder holds a fit already that is not to be resumed.
    """
    if out.suffix != SUFFIX:
        raise InputError(f"{out}: a surface is written as {SUFFIX}; give -o {out.stem or 'surface'}{SUFFIX}")
    folder = out.with_suffix(".fit")
    if not resume and CheckpointFiles(folder).exist():
        raise InputError(f"{folder}: holds a fit already; continue it with --resume, or give another -o")
    return folder

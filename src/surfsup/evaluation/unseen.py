"""What of the data that a model is judged by its training had not seen."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from surfsup.evaluation.load_trajectories import Truth
from surfsup.learned.training_domain import TrainingDomain

NAMED = 4  # more would not be read


def unseen(seen: TrainingDomain | None, truths: Sequence[Truth]) -> dict[str, str]:
    """Data set -> one line on what of its scenes the weights were not trained for; those that are like training are not
    in it.

    That a model must do with solids it never saw is often the very point of judging it, so unlike in a simulation these
    are told too.

    Args:
        seen: in training; None where that is not known, so that nothing can be told.
        truths: the scenes.
    """
    if seen is None:
        return {}
    told = {}
    for data in dict.fromkeys(truth.data for truth in truths):
        scenes = [truth.scene for truth in truths if truth.data == data]
        strange = Counter(what for scene in scenes for what in [*seen.unlike_solid(scene), *seen.unlike(scene)])
        if strange:
            named = [f"{what} ({count} of {len(scenes)} scenes)" for what, count in strange.most_common(NAMED)]
            more = [f"{len(strange) - NAMED} more such"] if len(strange) > NAMED else []
            told[data] = f"{data}: {seen.complaint([*named, *more])}"
    return told

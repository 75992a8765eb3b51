"""Warnings about evaluated scenes that are outside a network's training domain."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from surfsup.evaluation.load_trajectories import ReferenceTrajectory
from surfsup.learned.training_domain import TrainingDomain

MAX_NAMED = 4  # differences in one warning


def domain_warnings(domain: TrainingDomain | None, references: Sequence[ReferenceTrajectory]) -> dict[str, str]:
    """Name of a data set -> one line on how its scenes differ from the training data; only data sets that differ.

    An evaluation reports solids outside the training domain too, which a simulation does not: they are often the very
    point of the evaluation.

    Args:
        domain: of the training data; None where it is not known, which gives no warnings.
        references: the scenes.
    """
    if domain is None:
        return {}
    warnings = {}
    for name in dict.fromkeys(reference.data_set for reference in references):
        scenes = [reference.scene for reference in references if reference.data_set == name]
        differences = Counter(
            one for scene in scenes for one in [*domain.unknown_surface(scene), *domain.differences(scene)]
        )
        if differences:
            named = [f"{one} ({count} of {len(scenes)} scenes)" for one, count in differences.most_common(MAX_NAMED)]
            more = [f"{len(differences) - MAX_NAMED} more such"] if len(differences) > MAX_NAMED else []
            warnings[name] = f"{name}: {domain.format_warning([*named, *more])}"
    return warnings

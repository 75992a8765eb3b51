"""The learned simulators by kind, the name in their weights files and presets."""

from __future__ import annotations

from surfsup.learned.base import LearnedSimulator
from surfsup.learned.corrected.simulator import CorrectedSimulator
from surfsup.learned.message_passing.gns import Gns
from surfsup.learned.message_passing.no_sdf import NoSdf
from surfsup.learned.message_passing.surfsup import Surfsup
from surfsup.learned.message_passing.value_only import ValueOnly

LEARNED_SIMULATORS: dict[str, type[LearnedSimulator]] = {
    simulator.kind: simulator for simulator in (CorrectedSimulator, Surfsup, ValueOnly, NoSdf, Gns)
}

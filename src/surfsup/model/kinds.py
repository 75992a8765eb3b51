"""All kinds of learned simulator, by the name under which their weights are saved."""

from __future__ import annotations

from surfsup.model.learned_simulator import LearnedSimulator
from surfsup.model.message_passing.gns import Gns
from surfsup.model.message_passing.no_sdf import NoSdf
from surfsup.model.message_passing.surfsup import Surfsup
from surfsup.model.message_passing.surfsup_velocity import SurfsupVelocity
from surfsup.model.message_passing.value_only import ValueOnly
from surfsup.model.simulator import Simulator

KINDS: dict[str, type[LearnedSimulator]] = {
    simulator.kind: simulator for simulator in (Simulator, Surfsup, SurfsupVelocity, ValueOnly, NoSdf, Gns)
}
